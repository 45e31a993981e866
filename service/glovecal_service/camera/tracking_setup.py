"""Everything that a camera's pictures are tracked with: built once, or taken from the data folder."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from glovecal_client.pictures.source import PictureSource
from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.pattern import printed_pattern
from glovecal_models.colour_glove.pose.hand_tracker import HandTracker
from glovecal_models.colour_glove.pose.prepared import prepared_tracker
from glovecal_models.colour_glove.pose.window_view import PrintedHand
from glovecal_models.colour_glove.pose_estimate import PoseEstimate
from glovecal_models.colour_glove.rasterise import rasterise
from glovecal_models.colour_glove.skin import hand_skin, posed
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.progress import Cancel, Report
from glovecal_service.camera.camera_settings import CameraSettings
from glovecal_service.camera.rendered_glove import INKS, RenderedGlove
from glovecal_service.camera.sources import camera_source

ASSUMED = Camera()


class Tracker(Protocol):
    def track(self, label_images: Sequence[np.ndarray], seconds: float) -> PoseEstimate | None: ...


class ColourLabels(Protocol):
    def labels(self, picture: np.ndarray) -> np.ndarray: ...


@dataclass(frozen=True, eq=False)
class TrackingSetup:
    """For one hand before one camera."""

    source: PictureSource
    """Not open."""
    hand: PrintedHand
    camera: Camera
    is_calibrated: bool
    """Whether focal length and distortion are known, not assumed."""
    colours: ColourLabels
    first: HandTracker
    """Of which other stages take database and errors."""
    made_from: str

    def tracker(self, stage: str) -> Tracker:
        """A new one, which has seen nothing yet. Raises BadInput for an unknown stage."""
        first = self.first
        return HandTracker(first.hand, first.lookup, first.cameras, first.errors, stage=stage)

    def findings(self, picture: np.ndarray, labels: np.ndarray) -> tuple[str, ...]:
        """What is wrong with the view, in plain sentences."""
        return ()

    def example(self) -> np.ndarray:
        """Labels of a hand before this camera: what kernels are compiled with before pictures wait."""
        skin, glove = self.hand.skin, RenderedGlove(self.hand, self.camera)
        drawn = rasterise(posed(skin, glove.state(0.0)), skin.triangles, self.camera)
        return drawn.painted(self.hand.pattern.colour)

    def name(self, stage: str) -> str:
        """64 hexadecimal digits: what poses are made with, as a calibration model's id names it."""
        return hashlib.sha256(f"{self.made_from} {stage}".encode()).hexdigest()


def tracking_setup(
    settings: CameraSettings,
    report: Report | None = None,
    cancelled: Cancel | None = None,
    source: PictureSource | None = None,
) -> TrackingSetup:
    """``source``: in place of the one that the settings name.

    Raises DeviceLost where no picture comes, BadInput for files that cannot be used, Cancelled.
    """
    skin = hand_skin(hand_skeleton(hand="left" if settings.hand == "left" else "right"))
    hand = PrintedHand(skin, printed_pattern())
    if source is None:
        source = camera_source(settings.source, lambda: RenderedGlove(hand, ASSUMED))
    camera = _assumed(_size(source))
    first = prepared_tracker(
        settings.folder, (camera,), skin=skin, pattern=hand.pattern, entries=settings.entries,
        clips=settings.clips, report=report, cancelled=cancelled,
    )  # fmt: skip
    made_from = repr((first.lookup.database.folder.name, camera, settings.clips))
    return TrackingSetup(source, hand, camera, source.name == "rendered", NearestInk(), first, made_from)


def _size(source: PictureSource) -> tuple[int, int]:
    """Height and width of its pictures."""
    source.open()
    try:
        height, width = source.read().pixels.shape[:2]
        return height, width
    finally:
        source.close()


def _assumed(size: tuple[int, int]) -> Camera:
    """The view of the assumed camera in a picture of another size."""
    height, width = size
    focal = ASSUMED.focal_px[0] * width / ASSUMED.width
    return Camera(width, height, (focal, focal), ((width - 1) / 2, (height - 1) / 2))


class NearestInk:
    """Labels by the nearest ink."""

    def labels(self, picture: np.ndarray) -> np.ndarray:
        best = np.full(picture.shape[:2], 1200, np.int32)
        found = np.zeros(picture.shape[:2], np.uint8)
        for label in range(1, len(INKS)):
            apart = ((picture.astype(np.int32) - INKS[label].astype(np.int32)) ** 2).sum(axis=2)
            nearer = apart < best
            best[nearer], found[nearer] = apart[nearer], label
        return found
