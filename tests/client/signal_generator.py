"""Test support: a device whose every reading follows from its number, and which can be made to misbehave.

It is a signal generator for tests, not a model of any glove.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Mapping

import numpy as np

from glovecal_client.capture.device import Reading
from glovecal_client.errors import DeviceFinished, DeviceLost


def values_of(number: int, sensors: int = 4) -> np.ndarray:
    """Sensor values of reading ``number``."""
    return (np.arange(sensors, dtype=np.float32) * 10 + number % 97).astype(np.float32)


class SignalGenerator:
    """Gives numbered readings; ``instead`` replaces the next ones, ``unplugged`` makes it vanish."""

    name = "signal-generator"
    layout = "four-sensors"
    sensors = ("A", "B", "C", "D")
    context = ("supply_v",)
    simulated = True
    counts = (0.0, 4095.0)

    def __init__(
        self, rate_hz: float = 200.0, frames: int | None = None, silent_after: int | None = None
    ) -> None:
        self.rate_hz = rate_hz
        self.unplugged = threading.Event()
        self.instead: deque[Callable[[], Reading] | BaseException] = deque()
        self.opened = 0
        self.given = 0
        self._frames = frames
        self._silent_after = silent_after
        self._due = 0.0

    @classmethod
    def from_options(cls, argument: str | None, options: Mapping[str, str]) -> SignalGenerator:
        return cls(float(options.get("rate", "200")))

    def open(self) -> None:
        if self.unplugged.is_set():
            raise DeviceLost("signal generator: not plugged in")
        self.opened += 1
        self._due = time.monotonic()

    def close(self) -> None:
        pass

    def read(self, timeout_s: float) -> Reading | None:
        if self.unplugged.is_set():
            raise DeviceLost("signal generator: unplugged")
        if self._frames is not None and self.given >= self._frames:
            raise DeviceFinished("signal generator: done")
        if self._silent_after is not None and self.given >= self._silent_after:
            time.sleep(timeout_s)
            return None
        self._due += 1 / self.rate_hz
        time.sleep(min(max(0.0, self._due - time.monotonic()), timeout_s))
        if self.instead:
            item = self.instead.popleft()
            if isinstance(item, BaseException):
                raise item
            return item()
        reading = self.reading(self.given)
        self.given += 1
        return reading

    def reading(
        self, number: int, *, values: np.ndarray | None = None, monotonic_ns: int | None = None
    ) -> Reading:
        """Reading ``number`` taken now, or with other values or another time."""
        return Reading(
            values_of(number) if values is None else values,
            time.monotonic_ns() if monotonic_ns is None else monotonic_ns,
            time.time_ns(),
            context=np.array([np.nan], np.float32),
            button=number % 2 == 1,
        )
