"""What these takes cannot decide, and the take that would: between rivals, or between an effect and chance.

The permutation test of a cause that changes from take to take needs many distinct permutations. With two
wearings, or few takes, or a context that hardly differs, no p value can be small enough, even where the cause
is there; a recording is proposed instead of a verdict.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, factorial, prod

import numpy as np

from glovecal_models.diagnosis.hold_drift import HAND, HoldDrift
from glovecal_models.diagnosis.known_effect import KnownEffect
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.diagnosis.permutation_test import wearing_permutations
from glovecal_models.diagnosis.residual_answer import FREE_MOTION, MORE_TAKES, MORE_WEARINGS, NextTake
from glovecal_models.diagnosis.unexplained_residual import UnexplainedResidual
from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.effect import CorrectionEffect, Effect
from glovecal_models.effects.base.relations import Motion
from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.catalogue import relations

SINGLE_POSES = "the frames are single poses; record the movement from one to the next"
STILL_HAND = "the hand keeps still: no rotation moves enough; record movement"
ONLY_POSE_NAMES = "the reference only names poses (0 or 1) and measures no angle"
NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
ORDINALS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth")


def asked_take(motion: str, what: str, seconds: int, separates: tuple[str, ...]) -> NextTake:
    """The recording, with the name that its take is to have."""
    name = FREE_MOTION if motion in (MORE_TAKES, MORE_WEARINGS) else motion.replace("_", "-")
    return NextTake(motion, what, seconds, separates, name)


@dataclass(frozen=True)
class NotIdentifiable:
    """An effect these takes cannot show."""

    effect: str
    why: str
    record: NextTake | None = None
    """The recording after which they could."""
    would_save: Assessment | None = None
    """What it saves on held-out takes, whether it is there or by chance."""

    @property
    def joints_saved(self) -> tuple[int, ...]:
        """Joints on which it saves as much as a session effect must."""
        if self.would_save is None:
            return ()
        errors, least = self.would_save.errors, self.would_save.limits.least_session_share
        return tuple(i for i, item in enumerate(errors) if item.saved >= least)

    @property
    def saves_much(self) -> bool:
        """Whether it may well be there."""
        return bool(self.joints_saved)

    @property
    def saved_square(self) -> float:
        """Squared degrees per row, summed over those joints."""
        if self.would_save is None:
            return 0.0
        some = [self.would_save.errors[i] for i in self.joints_saved]
        return float(sum((item.base.sum() - item.added.sum()) / item.rows for item in some))


@dataclass(frozen=True)
class Undecidable:
    """Why takes cannot decide, and the recording after which they can."""

    why: str
    record: NextTake


def as_known(item: NotIdentifiable, effects: Mapping[str, Effect]) -> KnownEffect:
    """On the joints where it saves much; ``effects`` by name."""
    found = item.would_save
    assert found is not None
    effect = effects[item.effect]
    where = tuple(found.joints[i] for i in item.joints_saved)
    return KnownEffect(effect, where, tuple(found.shapes[i] for i in item.joints_saved))


def take_to_decide(impossible: Sequence[NotIdentifiable], residual: UnexplainedResidual) -> NextTake | None:
    """The recording that makes an effect identifiable: one that saves much; else a further wearing, where
    something is unexplained."""
    asked = [item for item in impossible if item.record is not None]
    likely = sorted((item for item in asked if item.saves_much), key=lambda item: -item.saved_square)
    unexplained = residual.is_significant or residual.obstacle is not None
    wearing = [item for item in asked if item.record and item.record.motion == MORE_WEARINGS and unexplained]
    return next((item.record for item in (*likely, *wearing)), None)


def undecidable(
    takes: Sequence[Signals], effect: CorrectionEffect, limits: DiagnosisLimits = DIAGNOSIS_LIMITS
) -> Undecidable | None:
    """None when there are enough permutations for the p value that the effect needs."""
    if effect.comparison.control == "permuted wearings":
        return _few_wearings(takes, effect, limits)
    return _few_takes(takes, effect, limits) if effect.context else None


def too_few(
    takes: Sequence[Signals], faint: Sequence[Assessment], limits: DiagnosisLimits
) -> list[NotIdentifiable]:
    """What would be named if so much of it were seen in many takes, and the takes to record."""
    more = max(limits.few_takes - len(takes), 1)
    more_takes = _more(more)
    why = f"{len(takes)} takes are too few to tell what may be saved from chance: record {more_takes}"
    what = f"Record {more_takes} in free motion."
    names = tuple(item.effect for item in faint)
    record = asked_take(MORE_TAKES, what, _seconds(takes, more), (*names, "chance"))
    return [NotIdentifiable(item.effect, why, record, item) for item in faint]


def _few_wearings(
    takes: Sequence[Signals], effect: CorrectionEffect, limits: DiagnosisLimits
) -> Undecidable | None:
    ways = 1 + len(wearing_permutations(takes, np.random.default_rng(0)))
    needed = ceil(1 / effect.comparison.certainty.clear)
    if ways >= needed:
        return None
    names = [take.wearing for take in takes]
    wearings = list(dict.fromkeys(names))
    each = max(limits.fewest_takes_of_a_wearing, max(names.count(name) for name in wearings))
    following = ORDINALS[len(wearings)] if len(wearings) < len(ORDINALS) else f"{len(wearings) + 1}th"
    many = NUMBERS[len(wearings)] if len(wearings) < len(NUMBERS) else str(len(wearings))
    spoken = effect.name.replace("_", " ")
    why = (
        f"{many} wearings allow {_permutations(ways)} of their takes, a {spoken} needs {needed} to be"
        f" significant: record a {following} wearing with {each} takes"
    )
    what = (
        f"Take the glove off, put it on again and record {each} takes with the same motions as before;"
        f" name it as a {following} wearing."
    )
    return Undecidable(why, asked_take(MORE_WEARINGS, what, _seconds(takes, each), (effect.name, "chance")))


def _few_takes(
    takes: Sequence[Signals], effect: CorrectionEffect, limits: DiagnosisLimits
) -> Undecidable | None:
    alike = limits.alike_context_share
    column = max(effect.context, key=lambda name: _arrangements(_levels(takes, name, alike)))
    levels = _levels(takes, column, alike)
    certainty, count = effect.comparison.certainty, sum(levels)
    least = min(certainty.clear, certainty.of_few_takes) if count < limits.few_takes else certainty.clear
    ways, needed = _arrangements(levels), ceil(1 / least)
    if ways >= needed:
        return None
    more = 1
    while _arrangements([*levels, *([1] * more)]) < needed:
        more += 1
    takes_so_far = (
        f"{count} take{'s' if count != 1 else ''} with {len(levels)} value{'s' * (len(levels) != 1)}"
    )
    more_takes = _more(more)
    why = (
        f"{takes_so_far} of c.{column} allow {_permutations(ways)}, {effect.name} needs {needed} to be"
        f" significant: record {more_takes}, each at another value of c.{column}"
    )
    what = f"Record {more_takes} in free motion, each at another value of c.{column} than all before."
    return Undecidable(why, asked_take(MORE_TAKES, what, _seconds(takes, more), (effect.name, "chance")))


def _more(takes: int) -> str:
    return f"{takes} more take{'s' if takes > 1 else ''}"


def _levels(takes: Sequence[Signals], column: str, equal: float) -> list[int]:
    """How many takes share a mean of the column, for each value of it; ``equal``: share of its range."""
    means = [float(np.nanmean(take.context[column])) for take in takes if _is_known(take, column)]
    every = np.concatenate([take.context[column] for take in takes if _is_known(take, column)])
    width = max(equal * float(np.nanmax(every) - np.nanmin(every)), 1e-12)
    steps = np.cumsum(np.append(0, np.diff(np.sort(means)) > width))
    return np.bincount(steps).tolist()


def _is_known(take: Signals, column: str) -> bool:
    return column in take.context and bool(np.isfinite(take.context[column]).any())


def _arrangements(levels: Sequence[int]) -> int:
    return factorial(sum(levels)) // prod(factorial(count) for count in levels)


def _permutations(count: int) -> str:
    return f"{count} permutation{'s' if count != 1 else ''}"


def _seconds(takes: Sequence[Signals], count: int) -> int:
    """So many takes as long as those before, in all."""
    each = float(np.median([take.time_s[-1] - take.time_s[0] for take in takes if len(take)]))
    return max(count, round(count * each))


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


Decides = Callable[[Effect, Motion], bool]


def next_take(
    rivals: Sequence[str], effects: Mapping[str, Effect], decides: Decides = lambda effect, motion: True
) -> NextTake | None:
    """For the members of a confidence set, the best first; None when nothing is to be decided, or can be.

    The first pair of rivals decides; without such a pair the recording in
    which the first shows most, as far as the others do not show in the same. ``decides``: whether a declared
    recording can still tell an effect from its rivals.
    """
    if len(rivals) < 2:
        return None
    known = [effects[name] for name in rivals if name in effects]
    pairs = list(itertools.combinations(known, 2))
    table = relations()
    declared = [(a, found) for a, b in pairs if (found := table.recording(a.name, b.name))]
    motion = next((found for item, found in declared if decides(item, found)), None)
    if motion is None and len(declared) == len(pairs):
        return None
    motion = motion or _shown_by_one(known) or ANYTHING
    return asked_take(motion.name, motion.what, motion.seconds, tuple(rivals))


def hold_next_take(drift: HoldDrift) -> NextTake | None:
    """For what a drift within held poses is consistent with; None when nothing is to be decided."""
    if len(drift.confidence_set) < 2:
        return None
    motion = RIGID_HOLDS if HAND in drift.confidence_set else WARM_HOLDS
    return asked_take(motion.name, motion.what, motion.seconds, drift.confidence_set)


def _shown_by_one(effects: Sequence[Effect]) -> Motion | None:
    """Of the motions in which effects show most, the first that is not that of all."""
    motions = [item.about.shown_by for item in effects]
    return next((item for item in motions if item is not None and motions.count(item) < len(motions)), None)
