"""A picture with what was found in it: the labels in flat colours, the model's patches in outline."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from glovecal_client.errors import BadOption
from glovecal_client.pictures.source import opencv
from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.hand_state import PoseEstimate
from glovecal_models.colour_glove.pattern import PRINTED_SRGB
from glovecal_models.colour_glove.pose.window_view import PrintedHand
from glovecal_models.colour_glove.rasterise import rasterise
from glovecal_models.colour_glove.skin import posed
from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean

LAYERS = ("picture", "labels", "model")
USUAL_WIDTH, WIDEST = 640, 1920
JPEG_QUALITY = 80
LABEL_SHARE = 0.65
"""Of a label's flat colour over the picture."""
DIM = 0.55
"""Of the picture below other layers."""
MODEL_COLOUR, EDGE_COLOUR = (255, 255, 255), (20, 20, 20)
BANNER = "SIMULATED"
_FLAT = np.concatenate([np.zeros((1, 3), np.uint8), PRINTED_SRGB[:, ::-1]])
"""Blue, green, red of each label."""


@dataclass(frozen=True, eq=False)
class SeenPicture:
    """One picture and what was found in it."""

    number: int
    pixels: np.ndarray | None
    """(H, W, 3); None where only labels came."""
    labels: np.ndarray
    """(H, W)."""
    estimate: PoseEstimate | None
    is_simulated: bool


def asked_layers(text: str) -> frozenset[str]:
    """From ``picture,labels,model``; all for an empty text. Raises BadInput."""
    layers = frozenset(text.split(",")) if text else frozenset(LAYERS)
    if not layers <= set(LAYERS):
        raise BadInput(f"layers {text!r}: {did_you_mean(text, LAYERS)}")
    return layers


def asked_width(text: str) -> int:
    """Raises BadInput."""
    width = int(text) if text.isdecimal() and len(text) < 6 else 0
    if text and not 16 <= width <= WIDEST:
        raise BadInput(f"width {text!r}: 16 to {WIDEST} pixels are possible")
    return width or USUAL_WIDTH


def drawn_view(seen: SeenPicture, hand: PrintedHand, camera: Camera, asked: Mapping[str, str]) -> bytes:
    """A JPEG of at most the width asked for. Raises BadInput for layers and widths that there are not."""
    layers, width = asked_layers(asked.get("layers", "")), asked_width(asked.get("width", ""))
    cv2 = opencv()
    height, wide = seen.labels.shape
    if "picture" in layers and seen.pixels is not None:
        drawn = seen.pixels.copy()
        if len(layers) > 1:
            drawn = (DIM * drawn).astype(np.uint8)
    else:
        drawn = np.full((height, wide, 3), 40, np.uint8)
    if "labels" in layers:
        glove = seen.labels > 0
        flat = _FLAT[np.minimum(seen.labels[glove], len(_FLAT) - 1)]
        drawn[glove] = (LABEL_SHARE * flat + (1 - LABEL_SHARE) * drawn[glove]).astype(np.uint8)
    if "model" in layers and seen.estimate is not None:
        placed = posed(hand.skin, seen.estimate.state)
        patches = rasterise(placed, hand.skin.triangles, camera).painted(hand.pattern.patch)
        edge = np.zeros(patches.shape, bool)
        edge[:, 1:] |= patches[:, 1:] != patches[:, :-1]
        edge[1:] |= patches[1:] != patches[:-1]
        around = cv2.dilate(edge.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        drawn[around] = EDGE_COLOUR
        drawn[edge] = MODEL_COLOUR
    if wide > width:
        drawn = cv2.resize(drawn, (width, max(1, round(height * width / wide))), interpolation=cv2.INTER_AREA)
    if seen.is_simulated:
        _banner(cv2, drawn)
    fine, jpeg = cv2.imencode(".jpg", drawn, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    if not fine:
        raise BadOption("the picture cannot be written as JPEG")
    return jpeg.tobytes()


def _banner(cv2, drawn: np.ndarray) -> None:  # type: ignore[no-untyped-def]
    """In the picture itself: it may be saved and shown elsewhere."""
    scale = drawn.shape[1] / 900
    font, size, edge = cv2.FONT_HERSHEY_SIMPLEX, max(scale, 0.3), 5
    (wide, high), below = cv2.getTextSize(BANNER, font, size, 1)
    cv2.rectangle(drawn, (0, 0), (wide + 2 * edge, high + below + 2 * edge), (0, 0, 0), cv2.FILLED)
    cv2.putText(drawn, BANNER, (edge, high + edge), font, size, (255, 255, 255), 1, cv2.LINE_AA)
