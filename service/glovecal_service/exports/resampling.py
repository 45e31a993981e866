"""Motion on even steps of a chosen rate, and with its fast parts taken out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_service.exports.hand_motion import HandMotion, at_times

ORDER = 2
"""Of a Butterworth filter that runs forward and backward: it delays nothing, and falls as one of order 4."""
MOST_OF_RATE = 0.45
"""The highest cutoff, as a share of the frame rate."""


@dataclass(frozen=True)
class Resampling:
    rate_hz: float | None = None
    """None: the frames' own times, or with a low-pass filter their median rate."""
    low_pass_hz: float | None = None
    """Cutoff (-3 dB each way) of the filter over angles; readings are never filtered."""

    def of(self, motions: Sequence[HandMotion]) -> list[HandMotion]:
        """``motions`` are on one time. Raises BadInput for a cutoff that the rate cannot hold."""
        time_s = motions[0].time_s
        if (self.rate_hz is None and self.low_pass_hz is None) or len(time_s) < 2:
            return list(motions)
        rate_hz = self.rate_hz or float(1 / np.median(np.diff(time_s)))
        if self.low_pass_hz is not None and self.low_pass_hz > MOST_OF_RATE * rate_hz:
            raise BadInput(
                f"a low-pass filter of {self.low_pass_hz:g} Hz is too high for {rate_hz:g} frames a second; "
                f"give at most {MOST_OF_RATE * rate_hz:.4g} Hz"
            )
        at = time_s[0] + np.arange(int((time_s[-1] - time_s[0]) * rate_hz + 1e-6) + 1) / rate_hz
        even = [at_times(motion, np.minimum(at, time_s[-1])) for motion in motions]
        notes = {"rate_hz": rate_hz}
        if self.low_pass_hz is not None:
            notes["low_pass_hz"] = self.low_pass_hz
            even = [replace(one, degrees=_low_passed(one.degrees, rate_hz, self.low_pass_hz)) for one in even]
        return [replace(one, notes={**one.notes, **notes}) for one in even]


def _low_passed(degrees: np.ndarray, rate_hz: float, cutoff_hz: float) -> np.ndarray:
    """Each column between its gaps; what is shorter than the filter's own transient stays as it is."""
    from scipy.signal import butter, sosfiltfilt  # slow to load, and seldom asked for

    sections = np.asarray(butter(ORDER, cutoff_hz, fs=rate_hz, output="sos"))
    shortest = 3 * (2 * len(sections) + 1)
    smooth = degrees.copy()
    for column in smooth.T:
        edges = np.flatnonzero(np.diff(np.isfinite(column), prepend=False, append=False))
        for begin, end in edges.reshape(-1, 2):
            if end - begin > shortest:
                column[begin:end] = sosfiltfilt(sections, column[begin:end])
    return smooth
