"""Hysteresis: the sensor reads differently on the way up than on the way down.

Several plays (Prandtl-Ishlinskii): the play of half-width r follows the joint only after it has moved 2 r
back. The inverse of such a sum is again one (Kuhnen 2003), so the same columns undo it. The columns are play
minus joint, which are bounded by r and zero for a width of zero. To be named it has their products with the
joint too: loops may be wider at one end, or cross in mid-range (butterfly).

Plays are the same both ways. Cloth that slides freely one way and is held the other is not: beside them stand
two pulls, each growing with the path one way and soon let go on the way back (Dahl 1968, with a length of its
own each way). What plays leave of such a sensor would look like creep.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.effects.base.dynamics import ArrayStateEffect, unbroken
from glovecal_models.effects.base.effect import CorrectionEffect, FormSignals, FurtherColumns
from glovecal_models.effects.base.facts import About, Parameter, Shape, Weights
from glovecal_models.effects.base.relations import RAMPS, LackOfMotion
from glovecal_models.effects.base.signals import Settings, Signals, fit_joint_units, in_joint_units

WIDTHS = (0.2, 0.5, 1.0)
"""Of the widest play: enough to name it, and what models had that were stored without widths."""
REPAIR_WIDTHS = (0.06, 0.13, 0.25, 0.4, 0.65, 1.0)
"""Loops of many small switches need more."""
PULL_LENGTHS = (3.0, 1.0)
"""Of a pull, on the way on which it grows and on the way on which it is let go, in widths of the widest play.
Of eight simulated gloves with hysteresis beside which creep stayed whatever was recorded, all are told with
this, seven at once. With 8 and 1.5, two of 48 gloves that creep were said to have hysteresis, with this one
(2026-11-29)."""
MOST_FORM_PLAYS = 3
"""A learned form is a function of so many plays."""
WIDEST_SHARES = (0.12, 0.25, 0.5)
"""Half-width of the widest play, in standard deviations of the motion. Wider ones imitate creep."""


PULL = "pull_lengths"
"""Settings of models that were stored without them have no pulls."""
CLOSING_AND_OPENING = np.array([1.0, -1.0])
FEWEST_TURNS = 4
SHORTEST_FOR_PRODUCTS_S = 5.0
"""Of the longest take. Strides are one cycle over and over: there a product with the joint is a function of
the cycle's phase, and anything that goes with the phase would bear the name."""


class Widest(Shape):
    """Of the motion's own spread."""

    def grid(self, takes: Sequence[Signals], settings: Settings) -> np.ndarray:
        spread = np.sqrt(np.mean([take.own.var(axis=0) for take in takes], axis=0))
        return np.array(WIDEST_SHARES)[:, None, None] * spread[None, :, None]


class MorePlays(FurtherColumns):
    """Without products with the joint: a learned form brings those."""

    def constants(self, effect: CorrectionEffect, takes: Sequence[Signals]) -> Settings:
        return {"widths": list(REPAIR_WIDTHS), PULL: list(PULL_LENGTHS)}


class Hysteresis(ArrayStateEffect):
    name = "hysteresis"
    about = About(
        "The sensor sticks: at the same angle it reads differently on the way up and on the way down.",
        source="Kuhnen 2003, European Journal of Control 9(4) 407; Dahl 1968; size: Mattmann 2008",
        shown_over="angle both ways",
        shows_in=("direction", "speed"),
        shown_by=RAMPS,
    )
    shape = Widest((Parameter("widest_play", "deg", 0.2, 30.0, "1 to 7 deg in bend sensors"),))
    further = MorePlays()

    def not_applicable_reason(self, takes: Sequence[Signals]) -> str | None:
        if any(_turns(take) >= FEWEST_TURNS for take in takes):
            return None
        return LackOfMotion("no joint goes to and fro in these takes", RAMPS)

    def fit_constants(self, takes: Sequence[Signals]) -> Settings:
        longest_s = max(float(np.ptp(take.time_s)) for take in takes)
        units = fit_joint_units(takes) if longest_s >= SHORTEST_FOR_PRODUCTS_S else {}
        return {PULL: list(PULL_LENGTHS), **units}

    def start(self, own: np.ndarray, settings: Settings, shape: np.ndarray) -> np.ndarray:
        """Plays, and where there are pulls the joint and these."""
        plays = np.repeat(own[:, None], len(_widths(settings)), axis=1)
        if PULL not in settings:
            return plays
        return np.column_stack([plays, own, np.full((len(own), 2), 0.5)])

    def step(
        self,
        state: np.ndarray,
        elapsed_s: float | np.ndarray,
        own: np.ndarray,
        settings: Settings,
        shape: np.ndarray,
    ) -> np.ndarray:
        width, joint = shape * _widths(settings), own[..., None]
        plays = state[..., : width.shape[-1]]
        np.minimum(joint + width, plays, out=plays)
        np.maximum(joint - width, plays, out=plays)
        loops = _beside_products(plays - joint, own, settings)
        if PULL not in settings:
            return loops
        before, pull = state[..., -3], state[..., -2:]
        keep, gain = _kept_and_gained((own - before)[..., None], settings, shape)
        state[..., -3] = own
        pull *= keep
        pull += gain
        return np.concatenate([loops, pull * shape], axis=-1)

    def run_takes(
        self, state: np.ndarray, elapsed_s: np.ndarray, own: np.ndarray, settings: Settings, shape: np.ndarray
    ) -> np.ndarray:
        widths = _widths(settings)
        width = (shape * widths).ravel()
        # One long axis: numpy is slow where it has to broadcast along a short last one.
        joint = np.repeat(own, len(widths), axis=-1)
        highest, lowest = joint + width, joint - width
        plays = np.empty_like(highest)
        before = state[..., : len(widths)].reshape(joint.shape[1:])
        for high, low, play in zip(highest, lowest, plays, strict=True):
            np.minimum(high, before, out=play)
            np.maximum(low, play, out=play)
            before = play
        each = (*own.shape[1:], len(widths))
        state[..., : len(widths)] = before.reshape(each)
        loops = np.subtract(plays, joint, out=plays).reshape(len(own), *each)
        loops = _beside_products(loops, own, settings)
        if PULL not in settings:
            return loops
        moved = np.diff(own, axis=0, prepend=state[None, ..., -3])
        kept, gain = _kept_and_gained(moved[..., None], settings, shape)
        before = state[..., -2:]
        for pull, gained in zip(kept, gain, strict=True):
            pull *= before
            pull += gained
            before = pull
        state[..., -3:] = np.concatenate([own[-1][..., None], before], axis=-1)
        return np.concatenate([loops, kept * shape], axis=-1)

    def unsettled(self, take: Signals, settings: Settings, shape: np.ndarray) -> np.ndarray:
        """A play forgets nothing with time: it is known once the joint has moved through all of it."""
        result = np.empty(take.own.shape, dtype=bool)
        for part in unbroken(take.time_s):
            own = take.own[part]
            moved = np.maximum.accumulate(own) - np.minimum.accumulate(own)
            result[part] = moved < 2.0 * shape[:, 0]
        return result

    def form_inputs(self, take: Signals, columns: np.ndarray, settings: Settings) -> FormSignals:
        widths = list(enumerate(_widths(settings)))
        every = max(len(widths) // MOST_FORM_PLAYS, 1)
        plays = {f"play {width:g}": columns[:, :, at] for at, width in widths[every - 1 :: every]}
        return FormSignals(plays, "deg")

    def weights(self, settings: Settings) -> Weights:
        names = tuple(f"play_{width:g}_of_widest_deg_per_deg" for width in _widths(settings))
        if _has_products(settings):
            names = (*names, *(f"{name}_per_sd" for name in names))
        both = ("pull_on_closing_deg_per_deg", "pull_on_opening_deg_per_deg")
        return Weights((*names, *both) if PULL in settings else names)


def _widths(settings: Settings) -> Sequence[float]:
    return settings.get("widths", WIDTHS)


def _has_products(settings: Settings) -> bool:
    return "own_scale_deg" in settings


def _beside_products(loops: np.ndarray, own: np.ndarray, settings: Settings) -> np.ndarray:
    """``loops`` (..., L, C) and, where the settings have the joint's units, their products with it."""
    if not _has_products(settings):
        return loops
    return np.concatenate([loops, loops * in_joint_units(own, settings)[..., None]], axis=-1)


def _kept_and_gained(
    moved: np.ndarray, settings: Settings, shape: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """What a move of ``moved`` (..., L, 1) degrees leaves of the two pulls and adds to them, (..., L, 2)."""
    grows, goes = settings[PULL]
    ways = np.maximum(moved * CLOSING_AND_OPENING, 0.0)
    ways /= shape
    kept = np.exp(ways * (-1.0 / grows))
    gained = 1.0 - kept
    kept *= np.exp(ways[..., ::-1] * (-1.0 / goes))
    return kept, gained


def _turns(take: Signals) -> int:
    """Reversals of the liveliest joint, counted where it has moved by half its standard deviation."""
    most = 0
    for own in take.own.T:
        steps = np.round((own - own.mean()) / max(float(own.std()), 1e-9))
        moves = np.sign(np.diff(steps[np.flatnonzero(np.diff(steps, prepend=np.inf))]))
        most = max(most, int(np.count_nonzero(np.diff(moves))))
    return most
