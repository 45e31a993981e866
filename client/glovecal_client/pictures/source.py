"""What a source of pictures is, and how one is named: ``camera:0``, ``video:FILE.mkv``, ``rendered``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from glovecal_client.clock import clock_ns, wall_ns
from glovecal_client.errors import BadOption, DeviceError
from glovecal_client.installation import not_installed

LARGEST_CAMERA = 63


@dataclass(frozen=True, eq=False)
class Picture:
    """One picture and when it was taken."""

    pixels: np.ndarray
    """uint8, (H, W, 3), blue, green, red, rows from the top."""
    monotonic_ns: int
    """``clock_ns()`` as soon as the picture was there: exposure and transfer came before."""
    wall_ns: int

    @classmethod
    def now(cls, pixels: np.ndarray) -> Picture:
        return cls(pixels, clock_ns(), wall_ns())


class PictureSource(Protocol):
    """Pictures one after another. Its methods raise DeviceLost once they cannot come any more."""

    @property
    def name(self) -> str: ...

    @property
    def simulated(self) -> bool:
        """Whether the pictures are drawn."""
        ...

    @property
    def rate_hz(self) -> float:
        """Nominal pictures a second, known once open."""
        ...

    def open(self) -> None:
        """Raises DeviceLost when nothing is there."""
        ...

    def read(self) -> Picture:
        """Wait for the next picture. Raises DeviceLost, DeviceFinished at the end of a file."""
        ...

    def close(self) -> None:
        """Harmless when already closed."""
        ...


def build_source(text: str) -> PictureSource:
    """The source written as ``text``, not yet opened. Raises BadOption; DeviceError without OpenCV."""
    kind, _, argument = text.partition(":")
    if kind == "rendered" and not argument:
        from glovecal_client.pictures.rendered import RenderedPictures

        return RenderedPictures()
    if kind == "camera" and argument.isdecimal() and int(argument) <= LARGEST_CAMERA:
        from glovecal_client.pictures.camera import CameraPictures

        return CameraPictures(int(argument))
    if kind == "video" and argument:
        from glovecal_client.pictures.video_file import VideoFilePictures

        return VideoFilePictures(Path(argument))
    raise BadOption(f"pictures {text!r} must be camera:NUMBER (0 is the first), video:FILE or rendered")


def opencv() -> Any:
    """The module ``cv2``. Raises DeviceError where it is not installed."""
    try:
        import cv2
    except ImportError as error:
        raise DeviceError(not_installed("reading pictures", "opencv-python-headless")) from error
    return cv2
