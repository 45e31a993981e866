"""Frame times as recorders write them: in other units than seconds, or stamped in batches."""

from __future__ import annotations

import numpy as np

SLOWEST_STEP_S = 1.5
"""Single poses set by hand come about once a second; a glove of 5 Hz or more in ms is above."""
FASTEST_RATE_HZ = 10_000.0
SLOWEST_RATE_HZ = 5.0
COARSEST_STAMP_S = 1.5
"""Whole seconds are still spread; a stamp for longer tells nothing of a hand."""
FEWEST_STAMPS = 3
LONGEST_PERIODS = 2.0
"""A batch whose frames would lie further apart than that many of the usual period is followed by a pause."""
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


def too_few_digits(time: np.ndarray) -> bool:
    """Whether stamps are too coarse to tell when a frame was taken: at least two frames each on average, and
    fewer than ``FEWEST_STAMPS`` of them or more than ``COARSEST_STAMP_S`` apart."""
    stamps = np.unique(time)
    if 2 * len(stamps) > len(time):  # a row that was written twice
        return False
    return len(stamps) < FEWEST_STAMPS or float(np.median(np.diff(stamps))) > COARSEST_STAMP_S


def spread_equal_times(time: np.ndarray) -> np.ndarray:
    """Times in which each run of equal values is spread over its batch; times that run backwards stay.

    Stamps cut down to a decimal place (whole seconds, say) stand for what follows up to the next: a batch
    begins at its stamp, and the first one, which may have begun before the recording, ends at the next. Other
    stamps are those of a buffer that was handed over, before or after its frames were taken: their frames lie
    around the stamp, so that none moves by more than half a batch. A pause belongs to no batch.
    """
    starts = np.flatnonzero(np.concatenate([[True], np.diff(time) != 0]))
    lengths = np.diff(np.append(starts, len(time)))
    steps = np.diff(time[starts])
    if len(starts) in (1, len(time)) or not (steps > 0).all():
        return time
    whole = slice(1 if len(steps) > 1 else 0, None)  # the first batch may have begun before the recording
    period = float(np.median((steps / lengths[:-1])[whole]))
    own = np.append(steps / lengths[:-1], min(period, float(np.median(steps)) / lengths[-1]))
    own = np.where(own > LONGEST_PERIODS * period, period, own)
    place = np.arange(len(time)) - np.repeat(starts, lengths)
    if not _is_cut_down(time[starts]):
        place = place - np.repeat((lengths - 1) / 2, lengths)
        return np.repeat(time[starts], lengths) + place * np.repeat(
            _apart(time[starts], lengths, own), lengths
        )
    spread = time + (place + 0.5) * np.repeat(own, lengths)
    first = np.arange(lengths[0])
    spread[: lengths[0]] = np.maximum(
        time[starts[1]] - (lengths[0] - first - 0.5) * period, time[0] + (first + 0.5) * own[0]
    )
    return spread


def _is_cut_down(stamps: np.ndarray) -> bool:
    """Whether stamps are whole numbers of their usual step: 1, 0.1, 0.01 ... seconds."""
    step = float(np.median(np.diff(stamps)))
    decimal = 10.0 ** round(np.log10(step))
    whole = stamps / decimal
    return abs(step / decimal - 1) < 0.01 and bool((np.abs(whole - np.round(whole)) < 1e-3).all())


def _apart(stamps: np.ndarray, lengths: np.ndarray, own: np.ndarray) -> np.ndarray:
    """How far the frames of each batch are apart: no batch reaches into its neighbours."""
    free = np.diff(stamps)
    room = 2 * free / (lengths[:-1] + lengths[1:])
    return np.minimum(own, np.minimum(np.append(room, np.inf), np.insert(room, 0, np.inf)) * (1 - 1e-9))
