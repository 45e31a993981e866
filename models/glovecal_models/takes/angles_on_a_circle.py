"""References that begin again after a full turn: -179 follows 180, or 1 follows 359.

A joint covers an arc of the circle and leaves the rest of it empty, in all of its takes. Angles are counted
from the middle of the empty arc, so that no angle of the joint lies beside the place where they begin again.
That is done only where nothing else is possible: the joint would have to turn by more than 180 degrees from
one row to the next, or by nearly a full turn over all takes, and on the circle it moves on smoothly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.takes.raw_table import LARGEST_ANGLE_DEG
from glovecal_models.takes.take import Take

TURN_DEG = 360.0
LEAST_SPAN_DEG = 270.0
"""Angles that span less are left alone."""
FAR_APART_DEG = 300.0
"""What takes must span together where none of them passes the place where angles begin again."""
LEAST_EMPTY_DEG = 60.0
"""Of the circle: a joint that covers more than the rest is not told from one that turns."""
CIRCLE_BINS = 72
STRAY_SHARE = 0.002
"""Of the rows; an arc with fewer in each of its bins of 5 degrees counts as empty."""
SMOOTH_DEG = 20.0
SMOOTH_TIMES = 2.0
"""Times the largest usual step (99 %); a step up to either goes on smoothly. Chosen, not tuned."""
MOST_SMOOTH_DEG = 90.0
MOSTLY_SMOOTH = 0.5
"""Share of the steps of more than half a turn that go on smoothly; others are wild rows."""


@dataclass(frozen=True)
class Unwrapped:
    """Takes whose angles are counted past a full turn, and a sentence on each take that was changed."""

    takes: tuple[Take, ...]
    sentences: tuple[str, ...]


def unwrapped(takes: Sequence[Take], beside: Sequence[Take] = ()) -> Unwrapped:
    """``beside``: takes of the same joints that are known already; angles are counted as theirs are."""
    result, sentences = list(takes), []
    for rotation in dict.fromkeys(name for take in takes for name in take.rotations):
        columns = [_column(take, rotation) for take in takes]
        shift = _whole_turns(columns, [_column(take, rotation) for take in beside])
        if shift is None:
            continue
        for number, (take, values, turned) in enumerate(zip(result, columns, shift, strict=True)):
            if np.isfinite(values).any() and turned.any():
                result[number] = _with_column(take, rotation, values + turned)
                sentences.append(_sentence(take, rotation, values, values + turned))
    return Unwrapped(tuple(result), tuple(sentences))


def _column(take: Take, rotation: str) -> np.ndarray:
    """(R,) degrees; nothing where the take has no such rotation."""
    if rotation not in take.rotations:
        return np.empty(0)
    return take.reference[:, take.rotations.index(rotation)]


def _whole_turns(columns: Sequence[np.ndarray], known: Sequence[np.ndarray]) -> list[np.ndarray] | None:
    """For each column (R,) degrees to be added, multiples of a turn; None: the angles stay as they are."""
    every = np.concatenate([np.empty(0), *columns])
    every = every[np.isfinite(every)]
    if not len(every):
        return None
    turns = [np.zeros(len(column)) for column in columns]
    centre = 0.5 * float(every.min() + every.max())
    if np.ptp(every) >= LEAST_SPAN_DEG:
        begins = _middle_of_the_empty_arc(every)
        if begins is not None:
            found = [begins + np.mod(column - begins, TURN_DEG) - column for column in columns]
            if _nothing_else_is_possible(columns, found):
                middle = begins + 0.5 * TURN_DEG
                turns = [part - TURN_DEG * np.floor(middle / TURN_DEG + 0.5) for part in found]
                centre = middle - TURN_DEG * np.floor(middle / TURN_DEG + 0.5)
    there = np.concatenate([np.empty(0), *known])
    there = there[np.isfinite(there)]
    if len(there):
        apart = centre - 0.5 * float(there.min() + there.max())
        turns = [part - TURN_DEG * np.floor(apart / TURN_DEG + 0.5) for part in turns]
    turns = [np.where(np.isfinite(part), np.round(part / TURN_DEG) * TURN_DEG, 0.0) for part in turns]
    after = np.concatenate([column + part for column, part in zip(columns, turns, strict=True)])
    if np.nanmax(np.abs(after)) > LARGEST_ANGLE_DEG or not any(part.any() for part in turns):
        return None
    return turns


def _middle_of_the_empty_arc(angles: np.ndarray) -> float | None:
    """Degrees; None where the joint leaves no arc of the circle empty."""
    counts, edges = np.histogram(np.mod(angles, TURN_DEG), CIRCLE_BINS, (0.0, TURN_DEG))
    free = counts <= STRAY_SHARE * len(angles)
    if free.all() or not free.any():
        return None
    first = int(np.argmin(free))
    edge = np.flatnonzero(np.diff(np.concatenate([[0], np.roll(free, -first).astype(int), [0]])))
    start, end = max(zip(edge[::2], edge[1::2], strict=True), key=lambda run: run[1] - run[0])
    width = TURN_DEG / CIRCLE_BINS
    if (end - start) * width < LEAST_EMPTY_DEG:
        return None
    return float(edges[first]) + 0.5 * (start + end) * width


def _nothing_else_is_possible(columns: Sequence[np.ndarray], turns: Sequence[np.ndarray]) -> bool:
    before = [np.diff(column[np.isfinite(column)]) for column in columns]
    after = [
        np.diff((column + turn)[np.isfinite(column)]) for column, turn in zip(columns, turns, strict=True)
    ]
    old, new = np.concatenate([np.empty(0), *before]), np.abs(np.concatenate([np.empty(0), *after]))
    large = np.abs(old) > 0.5 * TURN_DEG
    if not large.any():
        spans = np.concatenate([column[np.isfinite(column)] for column in columns])
        return bool(np.ptp(spans) > FAR_APART_DEG)
    usual = float(np.quantile(new, 0.99))
    smooth = min(max(SMOOTH_DEG, SMOOTH_TIMES * usual), MOST_SMOOTH_DEG)
    return bool((new[large] <= smooth).mean() >= MOSTLY_SMOOTH)


def _with_column(take: Take, rotation: str, values: np.ndarray) -> Take:
    reference = take.reference.copy()
    reference[:, take.rotations.index(rotation)] = values
    return replace(take, reference=reference)


def _sentence(take: Take, rotation: str, before: np.ndarray, after: np.ndarray) -> str:
    rows = np.flatnonzero(np.isfinite(before))
    passes = 1 + np.flatnonzero(np.abs(np.diff(before[rows])) > 0.5 * TURN_DEG)
    low, high = float(after[rows].min()), float(after[rows].max())
    how = "is a full turn off the other takes"
    if len(passes):
        times = "once" if len(passes) == 1 else f"{len(passes)} times"
        how = f"steps by a full turn {times} (first at {take.reference_time_s[rows[passes[0]]]:.2f} s)"
    return (
        f"Take {take.name!r}: {rotation} {how}: its angles lie on a circle. They were unwrapped and now go "
        f"from {low:.0f} to {high:.0f} degrees."
    )
