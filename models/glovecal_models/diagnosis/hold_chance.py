"""Could holds drift so much alike by chance? Whole holds are turned around, all their sensors at once.

Readings within a hold are far from independent, and the sensors of one hand drift together: a whole hold is
the unit. A drift that is there by chance has either sign, and speeds up as often as it slows down.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from glovecal_models.diagnosis.hold_fit import HoldFit

DRAWN = 4000
"""Ways to turn the holds around; all of them when there are fewer."""


def probability_of(fits: Sequence[HoldFit], generator: np.random.Generator) -> float:
    """The smaller of two, doubled: holds turned upside down, and holds also reversed in time."""
    upside = [np.stack([fit.changes, -fit.changes]) for fit in fits]
    reversed_too = [
        np.stack([fit.changes, -fit.changes, fit.reversed_changes, -fit.reversed_changes]) for fit in fits
    ]
    return min(1.0, 2.0 * min(_chance(ways, generator) for ways in (upside, reversed_too)))


def _chance(ways: Sequence[np.ndarray], generator: np.random.Generator) -> float:
    """Share of draws as common as the changes are; ``ways``: for each pose (W, H, S), as they are first."""
    count, kinds = sum(part.shape[1] for part in ways), len(ways[0])
    if kinds**count <= DRAWN:
        chosen = np.array(list(itertools.product(range(kinds), repeat=count)))
    else:
        chosen = generator.integers(0, kinds, (DRAWN, count))
        chosen[0] = 0
    common, start = np.zeros(len(chosen)), 0
    for part in ways:
        holds = np.arange(part.shape[1])
        total = part[chosen[:, start + holds], holds].sum(axis=1)
        common += (total**2 / np.maximum((part[0] ** 2).sum(axis=0), 1e-24)).sum(axis=1)
        start += part.shape[1]
    return float(np.mean(common >= common[0] * (1 - 1e-9)))
