"""The next take that would decide between rivals, with its length and instructions."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from glovecal_models.diagnosis.hold_drift import HAND, HoldDrift
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.facts import Motion

MORE_WEARINGS = "more_wearings"
MORE_TAKES = "more_takes"
RIGID_HOLDS = Motion(
    "rigid_holds",
    "Close the hand around a rigid form, such as a rod or a bottle, so that it cannot relax, and hold it for"
    " 20 s; open the hand for 10 s; six times. Name the pose rigid-fist, and give these takes together with"
    " the others.",
    180,
)
WARM_HOLDS = Motion(
    "long_warm",
    "Wear the switched-on glove for 10 min without touching it, then hold the same poses again; give the"
    " seconds since power-on as c.power_on_s.",
    120,
)
ANYTHING = Motion(
    MORE_TAKES,
    "Record three more takes of 20 s in free motion: no motion is known that decides, but more data may.",
    60,
)


@dataclass(frozen=True)
class NextTake:
    """A recording to make, and what it separates."""

    motion: str
    what: str
    seconds: int
    separates: tuple[str, ...]
    """Effects; "chance" where the takes are too few to tell an effect from it."""


Decides = Callable[[Effect, Motion], bool]


def next_take(
    rivals: Sequence[str], effects: Mapping[str, Effect], decides: Decides = lambda effect, motion: True
) -> NextTake | None:
    """For the members of a confidence set, the best first; None when nothing is to be decided, or can be.

    The first pair of which one names the other as its rival decides; without such a pair the recording in
    which the first shows most, as far as the others do not show in the same. ``decides``: whether a declared
    recording can still tell an effect from its rivals.
    """
    if len(rivals) < 2:
        return None
    known = [effects[name] for name in rivals if name in effects]
    pairs = list(itertools.combinations(known, 2))
    declared = [(a, found) for a, b in pairs if (found := _declared(a, b) or _declared(b, a))]
    motion = next((found for item, found in declared if decides(item, found)), None)
    if motion is None and len(declared) == len(pairs):
        return None
    motion = motion or _shown_by_one(known) or ANYTHING
    return NextTake(motion.name, motion.what, motion.seconds, tuple(rivals))


def hold_next_take(drift: HoldDrift) -> NextTake | None:
    """For what a drift within held poses is consistent with; None when nothing is to be decided."""
    if len(drift.confidence_set) < 2:
        return None
    motion = RIGID_HOLDS if HAND in drift.confidence_set else WARM_HOLDS
    return NextTake(motion.name, motion.what, motion.seconds, drift.confidence_set)


def _declared(effect: Effect, other: Effect) -> Motion | None:
    return next((item.told_apart_by for item in effect.rivals if item.effect == other.name), None)


def _shown_by_one(effects: Sequence[Effect]) -> Motion | None:
    """Of the motions in which effects show most, the first that is not that of all."""
    motions = [item.shown_by for item in effects]
    return next((item for item in motions if item is not None and motions.count(item) < len(motions)), None)
