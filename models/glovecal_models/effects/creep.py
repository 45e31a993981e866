"""Creep: after each movement the reading goes on changing for seconds, as foam and glue give way.

Three relaxations (standard linear solid): x' = (joint - x) / tau; the columns are x of each time constant, in
the ratio of a logarithmic grid. What came before a take is not known: the state starts where the hand is, as
if it had rested there, and three columns that decay tell how much of the way from the usual posture it still
has to go (learned; the best guess without a recording of the time before).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.effects.base.dynamics import ArrayStateEffect
from glovecal_models.effects.base.effect import CorrectionEffect, FormSignals, FurtherColumns
from glovecal_models.effects.base.facts import About, DriftInHolds, Parameter, Shape, Weights
from glovecal_models.effects.base.relations import RAMPS, LackOfMotion
from glovecal_models.effects.base.relaxation import relax, relax_once
from glovecal_models.effects.base.signals import Settings, Signals, fit_joint_units, on_lanes

RATIO = 4.0
"""Between neighbouring time constants: close enough for a logarithmic or power law between them."""
SLOW_S = (8.0, 12.0, 18.0, 26.0, 40.0)
BESIDE = (4.0, 1 / 64)
"""Further relaxations where creep is learned, in times of the slow one: a logarithmic or power law has
neither a fastest nor a slowest."""
SLOWEST_SD = 0.2
"""Of the weights of a relaxation slower than a take, and of what it started with: it is nearly an offset of
each take, of which there are few. Eight simulated gloves with a pre-roll were repaired to 1.2 to 3.3 times
a clean glove's error with 1 (median 1.5), to 1.2 to 1.9 with 0.2 (1.35; 2026-11-24)."""
FASTEST_S = 0.4
"""Of a relaxation: what is faster is a lag, which creep must not take for itself."""
PARTS = ("fast", "middle", "slow")
LONGEST_SHARE = 0.7
"""Of a take's length: a slower relaxation cannot be told from a constant."""


class Series(Shape):
    """Three time constants in a fixed ratio."""

    def grid(self, takes: Sequence[Signals], settings: Settings) -> np.ndarray:
        longest = max(float(take.time_s[-1] - take.time_s[0]) for take in takes)
        slow = np.array([tau for tau in SLOW_S if tau <= LONGEST_SHARE * longest] or SLOW_S[:1])
        series = slow[:, None] / RATIO ** np.arange(2, -1, -1)
        return np.repeat(series[:, None, :], takes[0].own.shape[1], axis=1)


class FurtherRelaxations(FurtherColumns):
    def constants(self, effect: CorrectionEffect, takes: Sequence[Signals]) -> Settings:
        return effect.fit_constants(takes) | {"beside": list(BESIDE), "fastest_s": FASTEST_S}


class Creep(ArrayStateEffect):
    name = "creep"
    about = About(
        "After a movement the reading goes on drifting for seconds although the joint is held.",
        source="standard linear solid, relaxations of 1 to 40 s: Springer 10.1007/978-3-030-25261-8_34",
        shown_over="hold",
        shows_in=("direction", "time in take"),
        shown_by=RAMPS,
        in_holds=DriftInHolds("begins anew with each hold", "creep"),
    )
    shape = Series(
        (
            Parameter("fast_tau", "s", 0.4, 60.0, "1 to 60 s"),
            Parameter("middle_tau", "s", 0.5, 60.0, "1 to 60 s"),
            Parameter("slow_tau", "s", 0.5, 60.0, "1 to 60 s"),
        )
    )
    further = FurtherRelaxations()

    def not_applicable_reason(self, takes: Sequence[Signals]) -> str | None:
        longest = max((float(take.time_s[-1] - take.time_s[0]) for take in takes), default=0.0)
        why = f"the longest take lasts {longest:.0f} s; creep needs 8 s or more"
        return None if longest >= 8.0 else LackOfMotion(why, RAMPS)

    def transient_s(self, shape: np.ndarray, settings: Settings) -> float:
        """Of the slowest relaxation, those beside the shape's among them."""
        return super().transient_s(shape, settings) * max([1.0, *_beside(settings)])

    def fit_constants(self, takes: Sequence[Signals]) -> Settings:
        return fit_joint_units(takes)

    def start(self, own: np.ndarray, settings: Settings, shape: np.ndarray) -> np.ndarray:
        usual = on_lanes(settings["own_centre_deg"], len(own)) if "own_centre_deg" in settings else own
        rested, away = own[:, None], (usual - own)[:, None]
        return np.where(_following(settings), rested, away)

    def step(
        self,
        state: np.ndarray,
        elapsed_s: float | np.ndarray,
        own: np.ndarray,
        settings: Settings,
        shape: np.ndarray,
    ) -> np.ndarray:
        towards = own[..., None] * _following(settings)
        relax_once(state, elapsed_s, towards, _times(shape, settings))
        return state - _without(towards, settings)

    def run_takes(
        self, state: np.ndarray, elapsed_s: np.ndarray, own: np.ndarray, settings: Settings, shape: np.ndarray
    ) -> np.ndarray:
        following = _following(settings)
        # One long axis: numpy is slow where it has to broadcast along a short last one.
        towards = np.repeat(own, len(following), axis=-1) * np.tile(following, own.shape[-1])
        towards = towards.reshape(*own.shape, len(following))
        states = relax(state, elapsed_s, towards, _times(shape, settings))
        return np.subtract(states, _without(towards, settings), out=states)

    def form_inputs(self, take: Signals, columns: np.ndarray, settings: Settings) -> FormSignals:
        each = {name: columns[:, :, at] for at, name in enumerate(PARTS)}
        return FormSignals(each, "deg")

    def weights(self, settings: Settings) -> Weights:
        beside = np.array(_beside(settings))
        further = np.where(beside > 1.0, SLOWEST_SD, 1.0)
        names = (
            *(f"{part}_share_deg_per_deg" for part in PARTS),
            *(f"{part}_start_deg_per_deg" for part in PARTS),
            *(f"share_of_{times:.3g}_slow_deg_per_deg" for times in beside),
            *(f"start_of_{times:.3g}_slow_deg_per_deg" for times in beside if times > 1.0),
        )
        return Weights(names, np.concatenate([np.ones(6), further, further[beside > 1.0]]))


def _beside(settings: Settings) -> Sequence[float]:
    """None in models that were stored without."""
    return settings.get("beside", ())


def _following(settings: Settings) -> np.ndarray:
    """(C,): 1 for a state that follows the joint, 0 for one that decays to nothing, as the slow ones have."""
    beside = _beside(settings)
    return np.array(
        [1.0] * 3 + [0.0] * 3 + [1.0] * len(beside) + [0.0] * sum(times > 1.0 for times in beside)
    )


def _without(towards: np.ndarray, settings: Settings) -> np.ndarray:
    """(..., L, C): what a state is told apart from: the joint now, or its usual posture where the state is so
    slow that joint and regressor would change places. Written over ``towards``."""
    slower = np.flatnonzero(np.array(_beside(settings)) > 1.0) + 6
    if len(slower):
        towards[..., slower] = on_lanes(settings["own_centre_deg"], towards.shape[-2])[:, None]
    return towards


def _times(shape: np.ndarray, settings: Settings) -> np.ndarray:
    """(L, C) time constants of ``shape`` (L, 3)."""
    beside = np.array(_beside(settings))
    further = np.maximum(shape[:, 2:] * beside, settings.get("fastest_s", 0.0))
    return np.concatenate([shape, shape, further, further[:, beside > 1.0]], axis=1)
