"""What a source of pictures is, and how one is named: ``camera:0``, ``video:FILE.mkv``, ``rendered``.

A webcam has the number that the operating system gives it; rendered pictures are drawn in place of a
camera's, at an even rate, and nothing of them was seen by a camera.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from glovecal_client.clock import clock_ns, clock_s, wall_ns
from glovecal_client.errors import BadOption, DeviceError, DeviceLost
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
        return RenderedPictures()
    if kind == "camera" and argument.isdecimal() and int(argument) <= LARGEST_CAMERA:
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


USUAL_HZ = 30.0


class CameraPictures:
    """Through OpenCV, at the size and rate that the camera chooses."""

    simulated = False

    def __init__(self, number: int) -> None:
        self.name: str = f"camera:{number}"
        self.rate_hz = USUAL_HZ
        self._number = number
        self._cv2 = opencv()
        self._camera: Any = None

    def open(self) -> None:
        self.close()
        camera = self._cv2.VideoCapture(self._number)
        if not camera.isOpened():
            camera.release()
            raise DeviceLost(f"{self.name} cannot be opened: is it plugged in, and free of other programs?")
        camera.set(self._cv2.CAP_PROP_BUFFERSIZE, 1)  # an old picture would have a new time stamp
        said = camera.get(self._cv2.CAP_PROP_FPS)
        self.rate_hz: float = said if 1 <= said <= 1000 else USUAL_HZ
        self._camera = camera

    def read(self) -> Picture:
        if self._camera is None:
            raise DeviceLost(f"{self.name} is not open")
        is_there, pixels = self._camera.read()
        if not is_there:
            raise DeviceLost(f"{self.name} gives no picture any more")
        return Picture.now(pixels)

    def close(self) -> None:
        camera, self._camera = self._camera, None
        if camera is not None:
            camera.release()


Draw = Callable[[float], np.ndarray]
"""Seconds since the source was opened to pixels, uint8 (H, W, 3)."""


class RenderedPictures:
    """``draw``: what is shown; by default a bar that sweeps once a second, and so tells the time."""

    simulated = True

    def __init__(self, draw: Draw | None = None, rate_hz: float = 30.0, name: str = "rendered") -> None:
        self.name: str = name
        self.rate_hz: float = rate_hz
        self._draw = draw or sweeping_bar
        self._began_s: float | None = None
        self._number = 0

    def open(self) -> None:
        self._began_s, self._number = clock_s(), 0

    def read(self) -> Picture:
        if self._began_s is None:
            raise DeviceLost(f"{self.name} is not open")
        at_s = self._number / self.rate_hz
        self._number += 1
        time.sleep(max(0.0, self._began_s + at_s - clock_s()))
        return Picture.now(np.ascontiguousarray(self._draw(at_s), dtype=np.uint8))

    def close(self) -> None:
        self._began_s = None


def sweeping_bar(time_s: float, height: int = 120, width: int = 160) -> np.ndarray:
    """A white bar whose column is the part of the second, on grey."""
    pixels = np.full((height, width, 3), 64, np.uint8)
    at = int(time_s % 1.0 * width)
    pixels[:, at : at + 4] = 255
    return pixels
