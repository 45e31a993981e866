"""What is left out of a fit when takes cannot be left out whole: quarters of time, or single levels."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

QUARTERS = 4
SHORT_S = 10.0
"""Takes of one motion each that are so short cannot be left out whole: nothing else shows that motion."""
FEWEST_LEVELS, MOST_LEVELS = 4, 40
SHORTEST_LEVEL = 5
"""Rows."""


def are_short(times: Sequence[np.ndarray]) -> bool:
    """Whether takes measured at these times are left out in pieces instead of whole."""
    return float(np.median([part[-1] - part[0] if len(part) else 0.0 for part in times])) < SHORT_S


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
