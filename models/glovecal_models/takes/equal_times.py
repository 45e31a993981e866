"""Frames stamped in batches: several rows with one time, spread evenly up to the next time."""

from __future__ import annotations

import numpy as np


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
