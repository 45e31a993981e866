"""Which readings of a device are fit to become frames."""

from __future__ import annotations

import numpy as np

from glovecal_client.capture.device import Device, Reading
from glovecal_client.clock import clock_ns

_MAX_AHEAD_NS = 1_000_000_000


class ReadingCheck:
    """Refuses readings that are not what the device said it produces, and tells why."""

    def __init__(self, device: Device) -> None:
        self._sensors = tuple(device.sensors)
        self._context = tuple(device.context)
        self._counts: tuple[float, float] | None = getattr(device, "counts", None)
        self._last_ns: int | None = None

    def is_duplicate(self, reading: Reading) -> bool:
        """Whether it was taken at the same nanosecond as the one before: the same reading given twice."""
        return self._last_ns is not None and reading.monotonic_ns == self._last_ns

    def fault(self, reading: Reading) -> str | None:
        """A sentence saying what is wrong, None if nothing is; the next must then be later than this."""
        fault = self._values_fault(reading) or self._time_fault(reading)
        if fault is None:
            self._last_ns = reading.monotonic_ns
        return fault

    def _values_fault(self, reading: Reading) -> str | None:
        try:
            readings, context = _as_sent(reading.readings), _as_sent(reading.context)
        except (TypeError, ValueError):
            return "its values are no numbers"
        if readings.shape != (len(self._sensors),):
            return f"{_size(readings)} sensor values instead of {len(self._sensors)}"
        if context.shape != (len(self._context),):
            return f"{_size(context)} context values instead of {len(self._context)}"
        if len(context) and np.isinf(context).any():
            return f"context {self._context[int(np.argmax(np.isinf(context)))]} is infinite"
        if self._is_within_counts(readings):
            return None
        bad = ~np.isfinite(readings)
        if bad.any():
            column = int(np.argmax(bad))
            return f"sensor {self._sensors[column]} reads {readings[column]}"
        return self._counts_fault(readings)

    def _is_within_counts(self, readings: np.ndarray) -> bool:
        """The usual case, told by two numbers: NaN and infinity are in no range."""
        if self._counts is None or not len(readings):
            return False
        return bool(self._counts[0] <= np.minimum.reduce(readings)) and bool(
            np.maximum.reduce(readings) <= self._counts[1]
        )

    def _counts_fault(self, readings: np.ndarray) -> str | None:
        if self._counts is None:
            return None
        low, high = self._counts
        outside = (readings < low) | (readings > high)
        if not outside.any():
            return None
        column = int(np.argmax(outside))
        return f"sensor {self._sensors[column]} reads {readings[column]:g}, outside {low:g} to {high:g}"

    def _time_fault(self, reading: Reading) -> str | None:
        for stamp in (reading.monotonic_ns, reading.wall_ns):
            if not isinstance(stamp, int) or not -(1 << 63) <= stamp < 1 << 63:
                return f"its time {stamp!r} is not a whole number of nanoseconds"
        if self._last_ns is not None and reading.monotonic_ns < self._last_ns:
            return f"its time is {(self._last_ns - reading.monotonic_ns) / 1e6:g} ms before the one before it"
        ahead_ns = reading.monotonic_ns - clock_ns()
        if ahead_ns > _MAX_AHEAD_NS:
            return f"its time is {ahead_ns / 1e9:g} s in the future"
        return None


def _as_sent(values: np.ndarray) -> np.ndarray:
    """As float32, which is what a frame holds; what is too large for it becomes infinite."""
    if isinstance(values, np.ndarray) and values.dtype == np.float32:
        return values
    with np.errstate(over="ignore"):
        return np.asarray(values, dtype=np.float32)


def _size(values: np.ndarray) -> str:
    return str(len(values)) if values.ndim == 1 else f"an array of shape {values.shape} with"
