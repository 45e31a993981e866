"""One pose, held several times: the drift that its holds have in common.

Each hold is fitted, sensor by sensor, with a level and b (1 - exp(-t / tau)) / (1 - exp(-T / tau)); b is the
change within the hold of length T, and tau is common to all holds and sensors of a pose.

A randomization test tells whether that is beyond chance: the sign of whole holds is flipped, of all their
sensors at once. Readings within a hold are far from independent, and the sensors of one hand drift together:
a whole hold is the unit. Under the null hypothesis a drift has either sign, and speeds up as often as it
slows down.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.diagnosis.posed_holds import PosedHold

GRID = 1.35
SHORTEST_TAU_S = 0.7


@dataclass(frozen=True)
class PoseDrift:
    """What all holds of one pose have in common."""

    pose: str
    holds: int
    duration_s: float
    """Median."""
    tau_s: float
    is_slowing: int
    """Holds that a slowing drift fits better than the same drift reversed in time."""
    share: np.ndarray
    """(S,) mean change within a hold, of the sensor's span, signed."""
    same_sign: np.ndarray
    """(S,) holds whose change has the sign of the mean."""
    level: np.ndarray
    """(S,) mean reading of the pose, in spans."""

    @property
    def tau_is_long(self) -> bool:
        """Whether the drift hardly slows down within the holds: its time constant is a lower bound."""
        return self.tau_s > 0.8 * self.duration_s


@dataclass(frozen=True)
class HoldFit:
    """All holds of one pose, fitted with one time constant."""

    held: tuple[PosedHold, ...]
    tau_s: float
    changes: np.ndarray
    """(H, S) within each hold."""
    levels: np.ndarray
    """(H, S) at the beginning of each."""
    reversed_changes: np.ndarray
    """(H, S) as they would be had time run backwards."""
    is_slowing: int

    @classmethod
    def of(cls, held: Sequence[PosedHold]) -> HoldFit:
        longest = max(hold.duration_s for hold in held)
        steps = int(np.log(longest / SHORTEST_TAU_S) / np.log(GRID)) + 1
        taus = SHORTEST_TAU_S * GRID ** np.arange(steps)
        tau = float(
            min(taus, key=lambda tau: sum(_fitted(hold, _course(hold.time_s, tau))[2] for hold in held))
        )
        fits = [_fitted(hold, _course(hold.time_s, tau)) for hold in held]
        turned = [_fitted(hold, 1.0 - _course(hold.time_s[-1] - hold.time_s, tau)) for hold in held]
        return cls(
            tuple(held),
            tau,
            np.array([fit[1] for fit in fits]),
            np.array([fit[0] for fit in fits]),
            -np.array([fit[1] for fit in turned]),
            sum(fit[2] < other[2] for fit, other in zip(fits, turned, strict=True)),
        )

    def in_common(self) -> PoseDrift:
        share = self.changes.mean(axis=0)
        return PoseDrift(
            self.held[0].pose,
            len(self.held),
            float(np.median([hold.duration_s for hold in self.held])),
            self.tau_s,
            self.is_slowing,
            share,
            (np.sign(self.changes) == np.sign(share)).sum(axis=0),
            (self.levels + 0.5 * self.changes).mean(axis=0),
        )


def _course(time_s: np.ndarray, tau: float) -> np.ndarray:
    """From 0 at the beginning of a hold to 1 at its end."""
    return np.expm1(-time_s / tau) / np.expm1(-time_s.max() / tau)


def _fitted(hold: PosedHold, course: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """(S,) levels at course 0, (S,) changes, and the sum of squares left."""
    columns = np.column_stack([np.ones(len(course)), course])
    weights, *_ = np.linalg.lstsq(columns, hold.readings, rcond=None)
    return weights[0], weights[1], float(np.sum((hold.readings - columns @ weights) ** 2))


DRAWN = 4000
"""Sign flips of the holds; all of them when there are fewer."""


def p_value_of(fits: Sequence[HoldFit], generator: np.random.Generator) -> float:
    """The smaller of two, doubled: holds with flipped sign, and holds also reversed in time."""
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
