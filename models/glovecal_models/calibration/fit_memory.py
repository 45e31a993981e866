"""Fits that this process did before: folds, turns and trials of several effects ask for the same ones.

Whatever effect is tried, the first turn trains the regressors of every fold without it; the same samples
with the same settings are the same task, by its key.
"""

from __future__ import annotations

from collections import OrderedDict
from threading import Lock

from glovecal_models.calibration.fit_task import FitResult, FitTask, run_task
from glovecal_models.progress import Cancel

MOST_BYTES = 64_000_000
"""Of arrays; the longest unused are forgotten first."""


class FitMemory:
    """Safe to use from several threads; two that ask for the same fit at once may both do it."""

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        self._most, self._bytes, self._lock = most_bytes, 0, Lock()
        self._fits: OrderedDict[str, FitResult] = OrderedDict()

    def fit(self, task: FitTask, *, cancelled: Cancel | None = None) -> FitResult:
        """As ``run_task``, whose results are never changed. Raises NotTrainable, Cancelled."""
        with self._lock:
            if task.key in self._fits:
                self._fits.move_to_end(task.key)
                return self._fits[task.key]
        result = run_task(task, cancelled=cancelled)
        with self._lock:
            if task.key not in self._fits:
                self._fits[task.key] = result
                self._bytes += _size(result)
            while self._bytes > self._most:
                self._bytes -= _size(self._fits.popitem(last=False)[1])
        return result


def _size(result: FitResult) -> int:
    return sum(array.nbytes for array in result.arrays.values())


KNOWN_FITS = FitMemory()
