"""Creep: after each movement the reading goes on changing for seconds, as foam and glue give way.

Three relaxations (standard linear solid): x' = (joint - x) / tau; the columns are x of each time constant, in
the ratio of a logarithmic grid. What came before a take is not known: the state starts where the hand is, as
if it had rested there, and three columns that decay tell how much of the way from the usual posture it still
has to go (learned; the best guess without a recording of the time before).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from glovecal_models.effects.base.facts import Parameter, Settings
from glovecal_models.effects.base.history_effect import ArrayStateEffect
from glovecal_models.effects.base.joint_units import fit_joint_units, on_lanes
from glovecal_models.effects.base.motions import RAMPS
from glovecal_models.effects.base.relaxation import relax, relax_once
from glovecal_models.effects.base.signals import Signals

RATIO = 4.0
"""Between neighbouring time constants: close enough for a logarithmic or power law between them."""
SLOW_S = (8.0, 12.0, 18.0, 26.0, 40.0)
FOLLOWING = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
"""Three states follow the joint, three decay to nothing."""
LONGEST_SHARE = 0.7
"""Of a take's length: a slower relaxation cannot be told from a constant."""


class Creep(ArrayStateEffect):
    name = "creep"
    explanation = "After a movement the reading goes on drifting for seconds although the joint is held."
    source = "standard linear solid, relaxations of 1 to 40 s: Springer 10.1007/978-3-030-25261-8_34"
    form_unit: ClassVar[str] = "deg"
    shown_by: ClassVar = RAMPS
    shows_in: ClassVar = ("direction", "time in take")
    drift_in_holds: ClassVar = "begins anew with each hold"
    parameters: ClassVar = (
        Parameter("fast_tau", "s", 0.4, 60.0, "1 to 60 s"),
        Parameter("middle_tau", "s", 0.5, 60.0, "1 to 60 s"),
        Parameter("slow_tau", "s", 0.5, 60.0, "1 to 60 s"),
    )

    def not_applicable_reason(self, takes: Sequence[Signals]) -> str | None:
        longest = max((float(take.time_s[-1] - take.time_s[0]) for take in takes), default=0.0)
        return None if longest >= 8.0 else f"the longest take lasts {longest:.0f} s; creep needs 8 s or more"

    def grid(self, takes: Sequence[Signals], settings: Settings) -> np.ndarray:
        longest = max(float(take.time_s[-1] - take.time_s[0]) for take in takes)
        slow = np.array([tau for tau in SLOW_S if tau <= LONGEST_SHARE * longest] or SLOW_S[:1])
        series = slow[:, None] / RATIO ** np.arange(2, -1, -1)
        return np.repeat(series[:, None, :], takes[0].own.shape[1], axis=1)

    def fit_constants(self, takes: Sequence[Signals]) -> Settings:
        return fit_joint_units(takes)

    def start(self, own: np.ndarray, settings: Settings, shape: np.ndarray) -> np.ndarray:
        usual = on_lanes(settings["own_centre_deg"], len(own)) if "own_centre_deg" in settings else own
        rested, away = own[:, None], (usual - own)[:, None]
        return np.concatenate([rested, rested, rested, away, away, away], axis=1)

    def step(
        self,
        state: np.ndarray,
        elapsed_s: float | np.ndarray,
        own: np.ndarray,
        settings: Settings,
        shape: np.ndarray,
    ) -> np.ndarray:
        towards = own[..., None] * FOLLOWING
        relax_once(state, elapsed_s, towards, np.tile(shape, 2))
        return state - towards

    def run(
        self, state: np.ndarray, elapsed_s: np.ndarray, own: np.ndarray, settings: Settings, shape: np.ndarray
    ) -> np.ndarray:
        towards = own[:, :, None] * FOLLOWING
        return relax(state, elapsed_s, towards, np.tile(shape, 2)) - towards

    def form_inputs(self, take: Signals, columns: np.ndarray, settings: Settings) -> Mapping[str, np.ndarray]:
        return {name: columns[:, :, at] for at, name in enumerate(("fast", "middle", "slow"))}

    def weight_names(self, settings: Settings) -> tuple[str, ...]:
        return (
            "fast_share_deg_per_deg",
            "middle_share_deg_per_deg",
            "slow_share_deg_per_deg",
            "fast_start_deg_per_deg",
            "middle_start_deg_per_deg",
            "slow_start_deg_per_deg",
        )
