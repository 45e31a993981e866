"""The last seconds of one live glove, looked at once a second: wrong wearer, wrong glove, dead sensor.

The predicting thread only copies a row 25 times a second; who asks for the status does the rest.
"""

from __future__ import annotations

import time
from dataclasses import asdict
from threading import Lock
from typing import Any

import numpy as np

from glovecal_models.diagnosis.worn_glove import GloveFinding, live_findings
from glovecal_service.realtime.served_model import ServedModel

WINDOW_S = 8.0
"""With looks a second apart a fault is told within 10 s of motion."""
STEP_NS = 40_000_000
FEWEST_ROWS = 40
LOOK_AGAIN_S = 0.9
CLEAR_LOOKS = 10
"""So many looks at a moving hand find nothing before a warning goes: one that comes to rest shows less."""
_WINDOW_NS = round(WINDOW_S * 1e9)
_ROWS = _WINDOW_NS // STEP_NS + 2


class LiveWatch:
    """Of one run of a glove with one model, or without any. ``add`` belongs to the predicting thread."""

    def __init__(self, run_id: int, model: ServedModel | None, sensors: tuple[str, ...]) -> None:
        self.run_id, self.model, self.sensors = run_id, model, sensors
        rotations = () if model is None else model.rotations
        self._times_ns = np.zeros(_ROWS, np.int64)
        self._readings = np.zeros((_ROWS, len(sensors)))
        self._degrees = np.zeros((_ROWS, len(rotations)))
        self._rows = 0
        self._began_ns: int | None = None
        self._next_ns = 0
        self._fit = None if model is None else model.wearer_fit
        self._found: tuple[GloveFinding, ...] = ()
        self._clear = 0
        self._looked_s = 0.0
        self._looked_rows = 0
        self._lock = Lock()

    def is_of(self, run_id: int, model: ServedModel | None, count: int) -> bool:
        """Whether it watches this run with this model, of so many sensors."""
        return run_id == self.run_id and model is self.model and count == len(self.sensors)

    def add(self, monotonic_ns: int, readings: np.ndarray, degrees: np.ndarray | None) -> None:
        """One frame: readings (S,), angles (R,) or None without a model."""
        if monotonic_ns < self._next_ns:
            return
        self._next_ns = max(self._next_ns + STEP_NS, monotonic_ns - STEP_NS)
        if self._began_ns is None:
            self._began_ns = monotonic_ns
        row = self._rows % _ROWS
        self._times_ns[row] = monotonic_ns
        self._readings[row] = readings
        if degrees is not None:
            self._degrees[row] = degrees
        self._rows += 1

    def warnings(self) -> list[dict[str, Any]]:
        """What is wrong, as JSON. While the hand rests, what was found last stays. From any thread."""
        with self._lock:
            now = time.monotonic()
            if now - self._looked_s >= LOOK_AGAIN_S and self._rows != self._looked_rows:
                self._looked_s, self._looked_rows = now, self._rows
                self._look()
            return [asdict(one) for one in self._found]

    def _look(self) -> None:
        times_ns = self._times_ns.copy()
        newest_ns = int(times_ns.max())
        if self._began_ns is None or newest_ns - self._began_ns < _WINDOW_NS:
            return
        rows = times_ns > newest_ns - _WINDOW_NS
        if rows.sum() >= FEWEST_ROWS:
            found = live_findings(self._readings[rows], self.sensors, self._fit, self._degrees[rows])
            if found is None:
                return
            self._clear = 0 if found else self._clear + 1
            if found or self._clear >= CLEAR_LOOKS:
                self._found = found
