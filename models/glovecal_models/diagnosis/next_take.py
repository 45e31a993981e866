"""The next take that would decide between rivals, with seconds and instructions."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.facts import Motion

MORE_WEARINGS = "more_wearings"
MORE_TAKES = "more_takes"
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


def next_take(rivals: Sequence[str], effects: Mapping[str, Effect]) -> NextTake | None:
    """For the members of a confidence set, the best first; None when nothing is to be decided.

    The first pair of which one names the other as its rival decides; without such a pair the recording in
    which the first shows most, as far as the others do not show in the same.
    """
    if len(rivals) < 2:
        return None
    known = [effects[name] for name in rivals if name in effects]
    pairs = itertools.combinations(known, 2)
    motion = next((found for a, b in pairs if (found := _declared(a, b) or _declared(b, a))), None)
    motion = motion or _shown_by_one(known) or ANYTHING
    return NextTake(motion.name, motion.what, motion.seconds, tuple(rivals))


def _declared(effect: Effect, other: Effect) -> Motion | None:
    return next((item.told_apart_by for item in effect.rivals if item.effect == other.name), None)


def _shown_by_one(effects: Sequence[Effect]) -> Motion | None:
    """Of the motions in which effects show most, the first that is not that of all."""
    motions = [item.shown_by for item in effects]
    return next((item for item in motions if item is not None and motions.count(item) < len(motions)), None)
