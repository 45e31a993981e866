"""A Gaussian belief about a hand's state, and the step that weighs it against what pictures say."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from glovecal_models.colour_glove.hand_state import RANGE_DEG, HandState

MOST_TURN_DEG, MOST_SHIFT_MM = 28.0, 80.0
"""Of one step: beyond, the linear model of a picture says nothing."""


@dataclass(frozen=True, eq=False)
class Belief:
    """A state and the covariance (26, 26) of steps away from it; degrees, degrees, mm."""

    state: HandState
    covariance: np.ndarray

    @cached_property
    def information(self) -> np.ndarray:
        """The inverse of the covariance."""
        return np.linalg.inv(self.covariance)


def damped_step(
    state: HandState, beliefs: tuple[Belief, ...], hessian: np.ndarray, gradient: np.ndarray, damping: float
) -> HandState:
    """The Gauss-Newton step of equation 2 (Wang & Popovic 2009, section 5.3), and of 5.4 with two beliefs.

    ``hessian`` (26, 26) and ``gradient`` (26,) are J' R^-1 J and J' R^-1 (c - f) of the pictures. Steps
    are cut to what a linear model bears, the answer to what a hand reaches.
    """
    total, pull = hessian.copy(), gradient.copy()
    for belief in beliefs:
        total += belief.information
        pull += belief.information @ belief.state.step_from(state)
    total[np.diag_indices_from(total)] *= 1.0 + damping
    step = np.linalg.solve(total, pull)
    # An angle that would leave its range stops there, and the others make the best of it.
    low, high = RANGE_DEG.T - state.angles_deg
    stuck = (step[:20] < low) & (pull[:20] < 0) | (step[:20] > high) & (pull[:20] > 0)
    if stuck.any():
        bound = np.flatnonzero(stuck)
        fixed = np.clip(step[bound], low[bound], high[bound])
        free = np.setdiff1d(np.arange(len(step)), bound)
        step[bound] = fixed
        step[free] = np.linalg.solve(
            total[np.ix_(free, free)], pull[free] - total[np.ix_(free, bound)] @ fixed
        )
    step[:23] = np.clip(step[:23], -MOST_TURN_DEG, MOST_TURN_DEG)
    step[23:] = np.clip(step[23:], -MOST_SHIFT_MM, MOST_SHIFT_MM)
    return state.moved(step).within_range()


def cost(state: HandState, beliefs: tuple[Belief, ...]) -> float:
    """Half the squared Mahalanobis distances to ``beliefs``."""
    return 0.5 * sum(
        float(apart @ belief.information @ apart)
        for belief in beliefs
        for apart in (belief.state.step_from(state),)
    )
