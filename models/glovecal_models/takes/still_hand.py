"""When a hand is still, told from readings: for poses of a quick check, steps of a sampling, and shapes.

A take's poses may be at any place, so ``still_stretches`` looks for all of them. A person who was asked for
one shape holds it at least for a second of what was recorded: ``stillest`` needs no limit. What a person does
at the moment is judged frame by frame (``sampling/state.py``), by the same blocks and the same share of the
range. Where angles were measured a joint is held while its angle stays (``comparison/holds.py``): noise
floors need the joint, not the hand, and may not look at the readings that they judge.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.takes.take import Take

BLOCK_S = 0.1
"""Stillness is judged on means of so long, so that noise is not taken for motion."""
STILL_SHARE = 0.05
"""Of a sensor's range: within it the sensor is still."""


def block_means(time_s: np.ndarray, readings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means (B, S) of ``readings`` (N, S) over ``BLOCK_S`` each, and the first row of each block (B,)."""
    number = ((time_s - time_s[0]) / BLOCK_S).astype(int)
    starts = np.flatnonzero(np.diff(number, prepend=-1))
    counts = np.diff(starts, append=len(number))
    return np.add.reduceat(readings, starts, axis=0) / counts[:, None], starts


def stays(labels: Sequence[str]) -> list[tuple[str, np.ndarray]]:
    """Each run of one label of N frames: the label and its rows."""
    names = np.array(labels, dtype=object)
    edges = np.flatnonzero(names[1:] != names[:-1]) + 1
    return [(str(names[rows[0]]), rows) for rows in np.split(np.arange(len(names)), edges)]


def still_stretches(
    time_s: np.ndarray,
    readings: np.ndarray,
    ranges: np.ndarray,
    *,
    most_share: float = STILL_SHARE,
    shortest_s: float,
) -> list[slice]:
    """Rows of ``readings`` (N, S) over which no sensor goes by more than ``most_share`` of its range, in
    readings (S,): as long as possible, at least ``shortest_s``."""
    if len(time_s) < 2 or not len(ranges):
        return []
    means, starts = block_means(time_s, readings)
    means = means / ranges
    found, begin = [], 0
    while begin < len(means):
        low = high = means[begin]
        end = begin + 1
        while end < len(means):
            low, high = np.minimum(low, means[end]), np.maximum(high, means[end])
            if (high - low).max() > most_share:
                break
            end += 1
        rows = slice(int(starts[begin]), int(starts[end]) if end < len(means) else len(time_s))
        is_long = time_s[rows.stop - 1] - time_s[rows.start] >= shortest_s
        if is_long:
            found.append(rows)
        begin = end if is_long else begin + 1
    return found


def stillest(take: Take, seconds: float = 1.0) -> slice:
    """Frames of the stillest ``seconds`` of what was asked for."""
    first = int(np.searchsorted(take.time_s, take.start_s))
    time_s, readings = take.time_s[first:], take.readings[first:]
    frames = max(1, int(np.searchsorted(time_s, time_s[0] + seconds)))
    step = max(1, frames // 10)
    spread = [
        float(readings[at : at + frames].std(axis=0).sum())
        for at in range(0, max(1, len(readings) - frames + 1), step)
    ]
    at = first + int(np.argmin(spread)) * step
    return slice(at, at + frames)
