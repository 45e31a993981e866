"""Frame times as recorders write them: in other units than seconds, or stamped in batches."""

from __future__ import annotations

import numpy as np

SLOWEST_STEP_S = 1.5
"""Single poses set by hand come about once a second; a glove of 5 Hz or more in ms is above."""
FASTEST_RATE_HZ = 10_000.0
SLOWEST_RATE_HZ = 5.0
_UNITS = (("milliseconds", 1e3), ("microseconds", 1e6), ("nanoseconds", 1e9))


def time_unit_warning(typical_step: float) -> str | None:
    """A sentence's end on a median step between frames (as if in seconds) that no glove has, else None."""
    if typical_step > SLOWEST_STEP_S:
        return f"one frame every {typical_step:.4g} s. time_s is wanted in seconds{unit_hint(typical_step)}."
    if typical_step < 1.0 / FASTEST_RATE_HZ:
        return (
            f"{1.0 / typical_step:.4g} frames a second. time_s is wanted in seconds; is it in minutes, hours"
            " or days?"
        )
    return None


def unit_hint(typical_step: float) -> str:
    """Which unit would make ``typical_step`` a glove's, as the end of a sentence; "" when none would."""
    for unit, per_second in _UNITS:
        rate_hz = per_second / typical_step
        if SLOWEST_RATE_HZ <= rate_hz <= FASTEST_RATE_HZ:
            return f"; if it is in {unit} ({rate_hz:.4g} Hz), divide by {per_second:.0e}".replace("e+0", "e")
    return ""


def spread_equal_times(time: np.ndarray) -> np.ndarray:
    """Times in which each run of equal values is spread over the interval to the next; the rest unchanged.

    Many gloves reach the computer through a buffer, so that a burst of frames gets one time stamp. The
    last run has no next time and gets the median interval. Times that run backwards stay as they are.
    """
    starts = np.flatnonzero(np.concatenate([[True], np.diff(time) != 0]))
    lengths = np.diff(np.append(starts, len(time)))
    steps = np.diff(time[starts])
    forward = steps[steps > 0]
    last = float(np.median(forward)) if len(forward) else 1.0
    until_next = np.append(steps, last)
    place = np.arange(len(time)) - np.repeat(starts, lengths)
    return time + place * np.repeat(until_next / lengths, lengths)
