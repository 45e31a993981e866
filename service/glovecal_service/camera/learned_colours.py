"""Tables of the glove's colours that are learned: on drawings, or on pictures that somebody has labelled."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.drawn.photograph import labelled_photographs
from glovecal_models.colour_glove.pattern import COLOURS, Pattern, printed_pattern
from glovecal_models.colour_glove.pictures.card_picture import CardColours
from glovecal_models.colour_glove.pictures.classify import ColourTable
from glovecal_models.colour_glove.skin import HandSkin, hand_skin
from glovecal_models.errors import BadInput

LABELS = ".labels.png"
"""What stands in place of a picture's suffix in the name of its label image."""


def drawn_table(
    skin: HandSkin | None = None, pattern: Pattern | None = None, card: CardColours | None = None
) -> ColourTable:
    """Learned on drawn photographs of the printed colours in white light; with ``card`` of the colours, and
    in the light, that its pictures tell."""
    skin = hand_skin() if skin is None else skin
    pattern = printed_pattern() if pattern is None else pattern
    inks, gains = None, (1.0, 1.0, 1.0)
    if card is not None:
        inks, gains = card.inks, (1.0 / card.gains.red, 1.0 / card.gains.green, 1.0 / card.gains.blue)
    photographs = labelled_photographs(skin, pattern, Camera(), inks=inks, gains=gains)
    return ColourTable.trained([each.picture for each in photographs], [each.labels for each in photographs])


def labelled_table(files: Sequence[Path]) -> ColourTable:
    """From pictures beside each of which lies a label image of its size: ``hand.jpg`` and
    ``hand.labels.png``, grey levels 0 (no glove) to 10. Raises BadInput for files that are none and for a
    colour that is missing."""
    pictures, labels = [picture_file(file) for file in files], []
    for file, picture in zip(files, pictures, strict=True):
        beside = file.with_name(file.stem + LABELS)
        label = _read(beside, cv2.IMREAD_UNCHANGED)
        if label is None or label.dtype != np.uint8 or label.shape != picture.shape[:2]:
            raise BadInput(
                f"{beside} must be a grey picture of {picture.shape[1]} x {picture.shape[0]} pixels, 8 bits, "
                f"whose levels are the glove's colours: 0 (none) to {COLOURS}"
            )
        if label.max() > COLOURS:
            raise BadInput(f"{beside} has level {label.max()}; colours are 0 (none) to {COLOURS}")
        labels.append(label)
    for colour in range(COLOURS + 1):
        if not any((label == colour).any() for label in labels):
            raise BadInput(
                f"colour {colour} is in none of the {len(labels)} label images; show all {COLOURS}"
            )
    return ColourTable.trained(pictures, labels)


def picture_file(file: Path) -> np.ndarray:
    """(H, W, 3) uint8 blue, green, red. Raises BadInput for a file that is no picture."""
    picture = _read(file, cv2.IMREAD_COLOR)
    if picture is None:
        raise BadInput(f"{file} cannot be read as a picture")
    return picture


def _read(file: Path, how: int) -> np.ndarray | None:
    try:
        content = np.frombuffer(file.read_bytes(), np.uint8)
    except OSError:
        return None
    return cv2.imdecode(content, how) if len(content) else None
