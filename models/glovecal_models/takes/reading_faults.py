"""Faults that readings show by themselves: spikes, dropouts, standing still, and frames played again.

The first three work on the readings (N,) of one sensor in one take and give a mask (N,) of the frames
concerned. A quick movement at a low rate looks like a spike or a dropout too: what the reference shows as
well was the joint, and where there is none, the frames must come fast enough to show a movement begin.

A driver that has no data plays its ring buffer again: whole runs of frames then equal those of a moment
before, in all columns, while the hand moves. The way back is the length of the buffer and always the same;
frames that happen to be equal lie any way back.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

SPIKE_SHARE = 0.08
"""Of the sensor's range: a smaller excursion may be a movement."""
SPIKE_SPREADS = 8.0
"""Times the robust spread of what a median over five frames takes away."""
JUMP_SHARE = 0.2
"""Of the range, within one frame: no finger does this."""
LEAST_STEPS = 3.0
"""Of the converter: a joint that hardly moves, read coarsely, goes through its range in few steps."""
STUCK_S, STUCK_FRAMES = 1.0, 20
GRADUAL_SHARE = 0.04
"""Of the range: this close to an end a sensor that stands still may be saturated instead."""
SHORTEST_BACK, LONGEST_BACK = 2, 60
"""Frames; one frame back is a plain repeat."""
FEWEST_IN_A_RUN = 3
FEWEST_REPLAYED, LEAST_SHARE_REPLAYED = 20, 0.01
"""Of all takes' frames: a slow movement of coarse readings comes back the way it went for half a percent."""
BEYOND_OTHERS = 5.0
"""Times more often than any other way back."""
SHOWN_WITHIN_S = 0.1
"""Before or after the readings: a sensor may be slow, and a reference has its own clock."""
MADE_SHARE = 0.4
"""Of an excursion or a step: where the reference shows so much of it, the joint may have made all of it."""
WIDEST_FRAME_S = 1.0 / 45.0
"""A tap of a finger is half over in 25 ms: of frames further apart a single one may be all of it."""
TIMES_BESIDE = 2.0
"""The steps before and after, which a step without a reference must exceed: a movement gathers speed."""


def spikes(time_s: np.ndarray, readings: np.ndarray, span: float, asked: np.ndarray) -> np.ndarray:
    """Excursions of one or two frames that come back, and that the joint did not make.

    ``span`` is the sensor's range in readings, ``asked`` (N,) the reference, as large as the
    readings; NaN without one.
    """
    if len(readings) < 5 or span <= 0:
        return np.zeros(len(readings), dtype=bool)
    # A frame is no farther from a median over five than two steps take it: mostly that is too little already.
    least = SPIKE_SHARE * span
    if 2.0 * float(np.abs(np.diff(readings)).max()) <= least:
        return np.zeros(len(readings), dtype=bool)
    away = np.abs(readings - median_of_five(np.pad(readings, 2, mode="edge")))
    if float(away.max()) <= least:
        return np.zeros(len(readings), dtype=bool)
    found = away > max(_least_of_noise(readings), least)
    # Where a level changes for good, the frames beside the step are no spikes.
    found &= ~_longer_than(found, 2)
    if not found.any():
        return found
    excursions = np.abs(asked - median_of_five(np.pad(asked, 2, mode="edge")))
    for first, after in _runs(found):
        shown = _shown(time_s, excursions, first, after)
        if np.isnan(shown):
            found[first:after] = _begins_and_ends_at_once(time_s, readings, first, after)
        elif shown >= MADE_SHARE * float(away[first:after].max()):
            found[first:after] = False
    return found


def _least_of_noise(readings: np.ndarray) -> float:
    """What noise and the converter's steps do not reach in (N,) readings, at least five.

    The range of a joint that hardly moves is that of its noise.
    """
    away = np.abs(readings - median_of_five(np.pad(readings, 2, mode="edge")))
    # The median of noise of about one step is 0.
    spread = max(1.4826 * float(np.median(away)), 1.2533 * float(np.mean(away)))
    return max(SPIKE_SPREADS * spread, LEAST_STEPS * smallest_step(readings))


def _shown(time_s: np.ndarray, moved: np.ndarray, first: int, after: int) -> float:
    """The most that the reference shows around these frames; NaN where it was not measured."""
    begin = np.searchsorted(time_s, time_s[first] - SHOWN_WITHIN_S)
    end = np.searchsorted(time_s, time_s[after - 1] + SHOWN_WITHIN_S, side="right")
    around = moved[min(begin, first) : max(end, after)]
    known = np.isfinite(around)
    return float(around[known].max()) if 2 * known.sum() > len(around) else np.nan


def _begins_and_ends_at_once(time_s: np.ndarray, readings: np.ndarray, first: int, after: int) -> bool:
    """Whether no movement does what ``readings`` do here, as far as frames of this rate can tell."""
    begin, end = max(first - 2, 0), min(after + 2, len(readings))
    if float(np.diff(time_s[begin:end]).max()) > WIDEST_FRAME_S:
        return False
    steps = np.abs(np.diff(readings[begin:end]))
    before, into = steps[: first - begin][:-1], steps[: first - begin][-1:]
    out, later = steps[after - 1 - begin :][:1], steps[after - 1 - begin :][1:]
    beside = float(np.concatenate([before, later]).max(initial=0.0))
    return bool((np.concatenate([into, out]) > TIMES_BESIDE * beside).all())


def median_of_five(padded: np.ndarray) -> np.ndarray:
    """(N,): of ``padded`` (N + 4,) values each with the two before it and the two after it."""
    one, two, middle, four, five = (padded[at : len(padded) - 4 + at] for at in range(5))
    low, high = np.minimum(one, two), np.maximum(one, two)
    other_low, other_high = np.minimum(four, five), np.maximum(four, five)
    # The least and the largest of four are out; it is the median of the two between them and the fifth.
    low, high = np.maximum(low, other_low), np.minimum(high, other_high)
    return np.maximum(np.minimum(low, high), np.minimum(np.maximum(low, high), middle))


def dropouts(time_s: np.ndarray, readings: np.ndarray, span: float, asked: np.ndarray) -> np.ndarray:
    """Runs of two frames or more at one constant value, entered and left by a jump that no joint made.

    ``span`` and ``asked`` as for ``spikes``.
    """
    found = np.zeros(len(readings), dtype=bool)
    start, end = constant_runs(readings)
    if span <= 0:
        return found
    inside = (start > 0) & (end < len(readings))
    start, end = start[inside], end[inside]
    entered = np.abs(readings[start] - readings[start - 1])
    left = np.abs(readings[end] - readings[end - 1])
    step = np.minimum(entered, left)
    jumps = step > JUMP_SHARE * span
    if not jumps.any():
        return found
    jumps &= step > _least_of_noise(readings)
    steps = np.abs(np.diff(asked, prepend=np.nan))
    for first, after, height in zip(start[jumps], end[jumps], step[jumps], strict=True):
        shown = _shown(time_s, steps, first, after + 1)
        if np.isnan(shown):
            found[first:after] = _begins_and_ends_at_once(time_s, readings, first, after)
        else:
            found[first:after] = shown < MADE_SHARE * height
    return found


def stuck(time_s: np.ndarray, readings: np.ndarray, low: float, high: float, moved: np.ndarray) -> np.ndarray:
    """Runs of one value for a second or more, outside the ends of the range ``low`` to ``high``.

    ``moved`` (N,) is what the reference has travelled, in multiples of what must be seen; a run counts
    when it travels by one or more inside it. A reference that does so within one frame jumps instead.
    """
    found = np.zeros(len(readings), dtype=bool)
    margin = GRADUAL_SHARE * (high - low)
    never_changes = high <= low
    start, end = constant_runs(readings)
    lasts = (end - start >= STUCK_FRAMES) & (time_s[end - 1] - time_s[start] >= STUCK_S)
    within = (low + margin < readings[start]) & (readings[start] < high - margin)
    possible = lasts & (within | never_changes)
    for first, after in zip(start[possible], end[possible], strict=True):
        inside = moved[first:after]
        steps = np.diff(inside[np.isfinite(inside)])
        path = np.cumsum(np.where(np.abs(steps) < 1.0, steps, 0.0))
        found[first:after] = len(path) > 0 and np.ptp(path, axis=0) >= 1.0
    return found


def constant_runs(readings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(R,) first frames of runs of two or more of one value, and (R,) the frames after them."""
    edges = np.concatenate([[0], np.flatnonzero(np.diff(readings) != 0) + 1, [len(readings)]])
    long = np.flatnonzero(np.diff(edges) >= 2)
    return edges[long], edges[long + 1]


def _longer_than(mask: np.ndarray, frames: int) -> np.ndarray:
    """The part of ``mask`` that stands in runs of more than so many frames."""
    result = np.zeros(len(mask), dtype=bool)
    for start, end in _runs(mask):
        result[start:end] = end - start > frames
    return result


def _runs(mask: np.ndarray) -> Iterator[tuple[int, int]]:
    """First frame of each run of ``mask``, and the frame after it."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    yield from zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)


def smallest_step(values: np.ndarray) -> float:
    """The quantum of (N,) values: their smallest change; 0 when they never change."""
    steps = np.abs(np.diff(values))
    steps = steps[np.isfinite(steps) & (steps > 0)]
    return float(steps.min()) if len(steps) else 0.0


def replayed(values: Sequence[np.ndarray]) -> list[np.ndarray]:
    """(N,) of each take's rows (N, K), True where they come again; all False where no way back stands out."""
    none = [np.zeros(len(part), dtype=bool) for part in values]
    again = {
        back: [_equal_runs(part, back) for part in values] for back in range(SHORTEST_BACK, LONGEST_BACK + 1)
    }
    counts = {back: sum(int(part.sum()) for part in found) for back, found in again.items()}
    back = max(counts, key=lambda each: counts[each])
    others = max((count for each, count in counts.items() if each % back), default=0)
    least = max(FEWEST_REPLAYED, LEAST_SHARE_REPLAYED * sum(map(len, values)), BEYOND_OTHERS * others)
    return again[back] if counts[back] >= least else none


def _equal_runs(values: np.ndarray, back: int) -> np.ndarray:
    """(N,) whether a row is one of a run that equal those so many before, and are not all alike."""
    found = np.zeros(len(values), dtype=bool)
    if len(values) <= back or not values.shape[1]:
        return found
    at = back + np.flatnonzero(values[back:, 0] == values[:-back, 0])
    at = at[(values[at] == values[at - back]).all(axis=1)]
    for run in np.split(at, np.flatnonzero(np.diff(at) > 1) + 1):
        if len(run) >= FEWEST_IN_A_RUN and (np.diff(values[run], axis=0) != 0).any(axis=1).all():
            found[run] = True
    return found
