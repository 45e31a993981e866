"""Lag: the sensor follows the joint late, as through a low pass of 5 to 150 ms.

The columns are the joint minus low-passed selves of it, with tau / 2 to 8 tau. Forward, that of tau alone
with weight -1 makes the lag. Inverse, they lead the reading back (the derivative, smoothed); together they
find how much smoothing the noise wants: one left 1.3 times the error of a glove without lag, five 1.2 times.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.comparison import Problem
from glovecal_models.effects.base.dynamics import ArrayStateEffect
from glovecal_models.effects.base.effect import Late
from glovecal_models.effects.base.facts import About, Parameter, Shape, Weights
from glovecal_models.effects.base.relations import FAST
from glovecal_models.effects.base.relaxation import relax, relax_once
from glovecal_models.effects.base.signals import Settings, Signals
from glovecal_models.effects.delay.delay_comparison import DelayComparison
from glovecal_models.effects.delay.delay_grid import DelayErrors, delay_errors, held_out_beside
from glovecal_models.effects.delay.delay_verdict import LAG

MULTIPLES = np.array([0.5, 1.0, 2.0, 4.0, 8.0])
TAU_S = (0.02, 0.03, 0.045, 0.065, 0.1, 0.15)
PRIOR = 8.0
"""Of the weights: with a time constant below the lag's own they are its ratio, and of either sign."""


@dataclass(frozen=True)
class LagComparison(DelayComparison):
    """Each joint has its own; the control leads by as much."""

    def assess(self, problem: Problem) -> Assessment:
        grids = delay_errors(problem)
        lags = [_best(grid, grid.lag) for grid in grids]
        mirrored = [_best(grid, grid.reversed_lag) for grid in grids]
        right, control = (
            [grid.blocks[:, cell] for grid, cell in zip(grids, cells, strict=True)]
            for cells in (lags, mirrored)
        )
        errors = held_out_beside(problem, right, control)
        taus = tuple(np.array([grid.delay_s[cell]]) for grid, cell in zip(grids, lags, strict=True))
        nothing = tuple(np.empty(0) for _ in grids)
        return Assessment(
            LAG, problem.rotations, errors, taus, nothing, None, ("tau_s",), limits=problem.limits
        )


class Lag(ArrayStateEffect, Late):
    name = LAG
    about = About(
        "The sensor follows the joint late: fast movements come out smaller and delayed.",
        source="first-order low pass, 5 to 150 ms (facts: rate-dependent flex sensors)",
        shown_over="speed",
        shows_in=("speed", "direction"),
        shown_by=FAST,
    )
    shape = Shape((Parameter("tau", "s", 0.005, 0.15, "5 to 150 ms", tried=TAU_S),))
    comparison = LagComparison()

    def not_applicable_reason(self, takes: Sequence[Signals]) -> str | None:
        return self.comparison.not_applicable_reason(takes)

    def start(self, own: np.ndarray, settings: Settings, shape: np.ndarray) -> np.ndarray:
        return np.repeat(own[:, None], len(MULTIPLES), axis=1)

    def step(
        self,
        state: np.ndarray,
        elapsed_s: float | np.ndarray,
        own: np.ndarray,
        settings: Settings,
        shape: np.ndarray,
    ) -> np.ndarray:
        relax_once(state, elapsed_s, own[..., None], shape * MULTIPLES)
        return own[..., None] - state

    def run_takes(
        self, state: np.ndarray, elapsed_s: np.ndarray, own: np.ndarray, settings: Settings, shape: np.ndarray
    ) -> np.ndarray:
        relaxed = relax(state, elapsed_s, own[..., None], shape * MULTIPLES)
        return own[..., None] - relaxed

    def weights(self, settings: Settings) -> Weights:
        return Weights(tuple(f"lead_{multiple:g}_tau_deg_per_deg" for multiple in MULTIPLES), PRIOR)

    def drawn_weights(self, prior_sd: np.ndarray, generator: np.random.Generator) -> np.ndarray:
        """The low pass of tau alone."""
        return np.where(MULTIPLES == 1.0, -1.0, 0.0)


def _best(grid: DelayErrors, cells: np.ndarray) -> int:
    return int(cells[np.argmin(grid.blocks[:, cells].sum(axis=0))])
