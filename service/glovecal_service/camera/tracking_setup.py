"""Everything that a camera's pictures are tracked with: built once, or taken from the data folder."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from glovecal_client.pictures.source import PictureSource
from glovecal_models.colour_glove.camera_file import read_cameras
from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.drawn.photograph import labelled_photographs
from glovecal_models.colour_glove.pattern import printed_pattern
from glovecal_models.colour_glove.pictures.classify import ColourTable
from glovecal_models.colour_glove.pictures.picture_check import PictureCheck
from glovecal_models.colour_glove.pose.hand_tracker import HandTracker
from glovecal_models.colour_glove.pose.prepared import prepared_tracker
from glovecal_models.colour_glove.pose.window_view import PrintedHand
from glovecal_models.colour_glove.pose_estimate import PoseEstimate
from glovecal_models.colour_glove.rasterise import rasterise
from glovecal_models.colour_glove.skin import hand_skin, posed
from glovecal_models.errors import BadInput
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.progress import Cancel, Report
from glovecal_service.camera.camera_settings import CameraSettings
from glovecal_service.camera.rendered_glove import RenderedGlove
from glovecal_service.camera.sources import RENDERED, camera_source

ASSUMED = Camera()
LEARNED = 1
"""Grows when the table learned from rendered photographs is to be learned anew."""


class Tracker(Protocol):
    def track(self, label_images: Sequence[np.ndarray], seconds: float) -> PoseEstimate | None: ...


@dataclass(frozen=True, eq=False)
class TrackingSetup:
    """For one hand before one camera."""

    source: PictureSource
    """Not open."""
    hand: PrintedHand
    camera: Camera
    is_calibrated: bool
    """Whether focal length and distortion are known, not assumed."""
    colours: ColourTable
    check: PictureCheck
    first: HandTracker
    """Of which other stages take database and errors."""
    made_from: str

    def tracker(self, stage: str) -> Tracker:
        """A new one, which has seen nothing yet. Raises BadInput for an unknown stage."""
        first = self.first
        return HandTracker(first.hand, first.lookup, first.cameras, first.errors, stage=stage)

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
    sizes = HandDimensions.from_measured(settings.sizes_mm)
    skin = hand_skin(hand_skeleton(sizes, "left" if settings.hand == "left" else "right"))
    hand = PrintedHand(skin, printed_pattern())
    if source is None:
        source = camera_source(settings.source, lambda: RenderedGlove(hand, ASSUMED))
    camera = _camera(settings, _size(source))
    first = prepared_tracker(
        settings.folder, (camera,), skin=skin, pattern=hand.pattern, entries=settings.entries,
        clips=settings.clips, report=report, cancelled=cancelled,
    )  # fmt: skip
    made_from = repr((first.lookup.database.folder.name, camera, settings.clips))
    check = PictureCheck(first.lookup)
    _ = check.distance_limit_px2  # takes a moment: not while pictures wait
    is_known = settings.calibration is not None or source.name == RENDERED
    return TrackingSetup(source, hand, camera, is_known, _colours(settings, hand), check, first, made_from)


def _size(source: PictureSource) -> tuple[int, int]:
    """Height and width of its pictures."""
    source.open()
    try:
        height, width = source.read().pixels.shape[:2]
        return height, width
    finally:
        source.close()


def _camera(settings: CameraSettings, size: tuple[int, int]) -> Camera:
    """The calibrated one, else the view of the assumed camera in a picture of this size."""
    height, width = size
    if settings.calibration is not None:
        camera = read_cameras(settings.calibration)[0]
        if (camera.width, camera.height) != (width, height):
            raise BadInput(
                f"{settings.calibration} is of {camera.width} x {camera.height}, but {settings.source} "
                f"gives {width} x {height}: calibrate it at this size"
            )
        return camera
    focal = ASSUMED.focal_px[0] * width / ASSUMED.width
    return Camera(width, height, (focal, focal), ((width - 1) / 2, (height - 1) / 2))


def _colours(settings: CameraSettings, hand: PrintedHand) -> ColourTable:
    """The table named, else one that was learned from rendered photographs of the printed colours."""
    if settings.colours is not None:
        return ColourTable.load(settings.colours)
    told = repr((LEARNED, labelled_photographs.__module__, hand.pattern.colour_of_patch.tolist()))
    file = settings.folder / f"colours-{hashlib.sha256(told.encode()).hexdigest()[:20]}.npz"
    if file.exists():
        try:
            return ColourTable.load(file)
        except BadInput:
            file.unlink()
    photographs = labelled_photographs(hand.skin, hand.pattern, ASSUMED)
    table = ColourTable.trained([each.picture for each in photographs], [each.labels for each in photographs])
    unfinished = file.with_suffix(f".{os.getpid()}")
    table.save(unfinished)
    unfinished.replace(file)
    return table
