"""Drawn pictures in place of a camera's, at an even rate. Nothing of them was seen by a camera."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from glovecal_client.clock import clock_s
from glovecal_client.errors import DeviceLost
from glovecal_client.pictures.source import Picture

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
