"""Held-out folds: whole takes; pieces of time when there is one take, or short ones; never random frames.

Neighbouring frames are alike, so a model scored on random frames is scored on frames it has seen.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.effects.base.control import motion_words
from glovecal_models.errors import NotTrainable

STRETCHES = 8
QUARTERS = 4
SHORT_S = 10.0
"""Takes of one motion each that are so short cannot be left out whole: nothing else shows that motion."""
FEWEST_LEVELS, MOST_LEVELS = 4, 40
SHORTEST_LEVEL = 5
"""Rows."""
MOST_WEARING_GROUPS = 4
"""Each is one more fit of every rotation."""


ALONE_SHARE = 0.1
"""Of the range of all units: an angle so far beyond those of all others is reached by one unit alone."""


@dataclass(frozen=True)
class Fold:
    """Which samples are left out, as a boolean mask of shape (N,), and what they are in words."""

    held_out: np.ndarray
    sentence: str


def folds_over_takes(take: np.ndarray, count: int) -> list[Fold]:
    """Up to ``count`` folds that together leave out every sample once.

    ``take`` (N,) is each sample's take index, samples of a take in order of time. With a single take its
    time is cut into stretches, dealt to the folds in turn.
    """
    if count < 1 or len(take) == 0:
        return []
    owners = np.unique(take)
    if len(owners) > 1:
        groups = [owners[start::count] for start in range(min(count, len(owners)))]
        return [Fold(np.isin(take, group), f"{len(group)} of {len(owners)} takes") for group in groups]
    stretch = np.minimum(np.arange(len(take)) * STRETCHES // len(take), STRETCHES - 1)
    return [
        Fold((stretch % count) == fold, f"stretches of the only take, one in {count}")
        for fold in range(count)
    ]


def usable_folds(
    folds: Iterable[np.ndarray], check_rest: Callable[[np.ndarray], object]
) -> list[tuple[int, np.ndarray]]:
    """Number and mask (N,) of what is left out, of those whose rest can carry a model.

    ``check_rest`` gets the mask (N,) of what is kept, and raises NotTrainable where that is too little: such
    a fold says nothing about the error.
    """
    found = []
    for number, held_out in enumerate(folds):
        try:
            check_rest(~held_out)
        except NotTrainable:
            continue
        found.append((number, held_out))
    return found


def wearing_groups(wearings: Sequence[str]) -> list[tuple[str, ...]]:
    """Wearings that are left out together, so that each is left out once; empty with a single one.

    ``wearings``: of each take.
    """
    names = list(dict.fromkeys(wearings))
    if len(names) < 2:
        return []
    count = min(len(names), MOST_WEARING_GROUPS)
    return [tuple(names[start::count]) for start in range(count)]


def are_short(times: Sequence[np.ndarray]) -> bool:
    """Whether takes measured at these times are left out in pieces instead of whole."""
    return float(np.median([part[-1] - part[0] if len(part) else 0.0 for part in times])) < SHORT_S


def alone_in_their_motion(names: Sequence[str], wearings: Sequence[str]) -> list[bool]:
    """Which takes are the only ones of their motion, told by their names, beside many of one other motion.

    Slow ramps among takes of free motion: left out whole, nothing would show what a model is then asked for.
    """
    motions = [motion_words(name, wearing) for name, wearing in zip(names, wearings, strict=True)]
    is_usual = 2 * max(Counter(motions).values(), default=0) > len(motions) > 1
    return [is_usual and motions.count(motion) == 1 for motion in motions]


def first_measured(reference: np.ndarray) -> int:
    """The first row of ``reference`` (N, R) in which anything was measured, 0 when nothing was.

    The frames before only tell effects with a memory where they stand: they are no time to leave out.
    """
    measured = np.isfinite(reference).any(axis=1)
    return int(np.argmax(measured)) if len(reference) else 0


def held_levels(reference: np.ndarray) -> list[slice] | None:
    """The runs in which ``reference`` (N, R) stands still, when it does nothing else; else None.

    A sensor set to known angles one after another: leaving out an angle asks what lies between the others.
    """
    values = np.nan_to_num(reference, nan=-1e9)
    if len(values) < FEWEST_LEVELS * SHORTEST_LEVEL:
        return None
    edges = [0, *(np.flatnonzero((np.diff(values, axis=0) != 0).any(axis=1)) + 1).tolist(), len(values)]
    lengths = np.diff(edges)
    if not FEWEST_LEVELS <= len(lengths) <= MOST_LEVELS or lengths.min() < SHORTEST_LEVEL:
        return None
    return [slice(int(a), int(b)) for a, b in itertools.pairwise(edges)]


def pieces(time_s: np.ndarray, reference: np.ndarray) -> list[slice]:
    """Levels held one by one, else quarters of the time measured; what lies before belongs to the first."""
    start = first_measured(reference)
    found = held_levels(reference[start:])
    edges = np.linspace(start, len(time_s), QUARTERS + 1).astype(int).tolist()
    if found is not None:
        edges = [start, *(start + part.stop for part in found)]
    return [slice(a, b) for a, b in itertools.pairwise([0, *edges[1:]])]


def reached_by_others(angles: Sequence[np.ndarray]) -> list[np.ndarray]:
    """For each unit a mask (N,) of the ``angles`` (N,) that its held-out error can be asked at.

    Where one unit alone goes far beyond all others, nothing is known of its sensor once it is left out: the
    base leaves many times its usual error, and whatever bends the curve seems to save it. Not where it would
    be most of the unit.
    """
    with_rows = [part for part in angles if len(part)]
    if len(with_rows) < 3:
        return [np.full(len(part), True) for part in angles]
    least = np.sort([part.min() for part in with_rows])
    most = np.sort([part.max() for part in with_rows])
    margin = ALONE_SHARE * (most[-1] - least[0])
    masks = [(part >= least[1] - margin) & (part <= most[-2] + margin) for part in angles]
    return [mask if 2 * mask.sum() > len(mask) else np.full(len(mask), True) for mask in masks]
