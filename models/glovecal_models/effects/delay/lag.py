"""Lag: the sensor follows the joint late, as through a low pass of 5 to 150 ms.

The columns are the joint minus low-passed selves of it, with tau / 2 to 8 tau. Forward, that of tau alone
with weight -1 makes the lag. Inverse, they lead the reading back (the derivative, smoothed); together they
find how much smoothing the noise wants: one left 1.3 times the error of a glove without lag, five 1.2 times.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from glovecal_models.effects.base.effect import Parameter, Settings, Signals
from glovecal_models.effects.base.history_effect import ArrayStateEffect
from glovecal_models.effects.base.relaxation import relax, relax_once

MULTIPLES = np.array([0.5, 1.0, 2.0, 4.0, 8.0])
TAU_S = (0.02, 0.03, 0.045, 0.065, 0.1, 0.15)
PRIOR = 8.0
"""Of the weights: with a time constant below the lag's own they are its ratio, and of either sign."""
FAST_SHARE = 1.0
"""Per second: a joint is moved fast when its speed reaches so many of its own standard deviations."""


class Lag(ArrayStateEffect):
    name = "lag"
    explanation = "The sensor follows the joint late: fast movements come out smaller and delayed."
    source = "first-order low pass, 5 to 150 ms (facts: rate-dependent flex sensors)"
    parameters: ClassVar = (Parameter("tau", "s", 0.005, 0.15, "5 to 150 ms"),)

    def missing(self, takes: Sequence[Signals]) -> str | None:
        fastest = max((_speed(take) for take in takes), default=0.0)
        return None if fastest >= FAST_SHARE else "no fast motion was recorded"

    def grid(self, takes: Sequence[Signals], settings: Settings) -> np.ndarray:
        return np.repeat(np.array(TAU_S)[:, None, None], takes[0].own.shape[1], axis=1)

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

    def run(
        self, state: np.ndarray, elapsed_s: np.ndarray, own: np.ndarray, settings: Settings, shape: np.ndarray
    ) -> np.ndarray:
        relaxed = relax(state, elapsed_s, own[:, :, None], shape * MULTIPLES)
        return own[:, :, None] - relaxed

    def prior_sd(self, settings: Settings) -> np.ndarray:
        return np.full(len(MULTIPLES), PRIOR)

    def weight_names(self, settings: Settings) -> tuple[str, ...]:
        return tuple(f"lead_{multiple:g}_tau_deg_per_deg" for multiple in MULTIPLES)


def _speed(take: Signals) -> float:
    """95th percentile of the speed of the liveliest joint, in its standard deviations per second."""
    if len(take) < 10:
        return 0.0
    speed = np.abs(np.diff(take.own, axis=0)) / np.diff(take.time_s)[:, None]
    return float(np.max(np.percentile(speed, 95, axis=0) / np.maximum(take.own.std(axis=0), 1e-9)))
