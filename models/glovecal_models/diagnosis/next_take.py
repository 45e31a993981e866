"""What these takes cannot decide, and the take that would: between rivals, or between an effect and chance.

The permutation test of a cause that changes from take to take needs many distinct permutations. With two
wearings, or few takes, or a context that hardly differs, no p value can be small enough, even where the cause
is there; a recording is proposed instead of a verdict.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import ceil

import numpy as np

from glovecal_models.diagnosis.hold_drift import HAND, HoldDrift
from glovecal_models.diagnosis.known_effect import KnownEffect
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.diagnosis.permutation_test import Wearings, levels_for, wearings_for
from glovecal_models.diagnosis.residual_answer import (
    CHANCE,
    FREE_MOTION,
    MORE_TAKES,
    MORE_WEARINGS,
    NextTake,
    PlannedTakes,
    TakePlan,
)
from glovecal_models.diagnosis.unexplained_residual import UnexplainedResidual
from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.effect import CorrectionEffect, Effect, kind_of, why_not_shown
from glovecal_models.effects.base.relations import LackOfMotion, Motion
from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.catalogue import relations

SINGLE_POSES = "the frames are single poses; record the movement from one to the next"
STILL_HAND = "the hand keeps still: no rotation moves enough; record movement"
ONLY_POSE_NAMES = "the reference only names poses (0 or 1) and measures no angle"
NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
ORDINALS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth")


def asked_take(motion: str, what: str, seconds: int, separates: tuple[str, ...], takes: int = 1) -> NextTake:
    """The recording, with the name that its takes are to have."""
    name = FREE_MOTION if motion in (MORE_TAKES, MORE_WEARINGS) else motion.replace("_", "-")
    return NextTake(motion, what, seconds, separates, name, takes)


BLOCK_S = 5
PLANNED_S = (20, 60)
"""Limits of a planned take in free motion, which is as long as those before."""
IN_FREE_MOTION = "Move all joints freely, as in everyday use."
AS_BEFORE = "Make the same motions as before."


@dataclass(frozen=True)
class Wanted:
    """Takes that an effect lacks."""

    takes: int = 1
    """Further ones; where there are ``wearings``, in each of them."""
    motion: Motion | None = None
    """None: any."""
    wearings: int = 0
    """Further ones."""
    column: str | None = None
    """A context column that has another value in each take than in all before."""
    names: tuple[str, ...] = ()
    """Of the takes of each further wearing, by which their motions are known as those before."""


@dataclass(frozen=True)
class NotIdentifiable:
    """An effect these takes cannot show."""

    effect: str
    why: str
    record: NextTake | None = None
    """The recording after which they could."""
    would_save: Assessment | None = None
    """What it saves on held-out takes, whether it is there or by chance."""
    wanted: tuple[Wanted, ...] = ()
    """Takes that are lacking; empty where no further take would show it."""

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
    wanted: Wanted


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
    more = max(limits.few_takes - len(takes), -(-len(takes) // 3))
    more_takes = _more(more)
    why = f"{len(takes)} takes are too few to tell what may be saved from chance: record {more_takes}"
    what = f"Record {more_takes} in free motion."
    names = tuple(item.effect for item in faint)
    record = asked_take(MORE_TAKES, what, _seconds(takes, more), (*names, CHANCE), more)
    return [NotIdentifiable(item.effect, why, record, item, (Wanted(more),)) for item in faint]


def _few_wearings(
    takes: Sequence[Signals], effect: CorrectionEffect, limits: DiagnosisLimits
) -> Undecidable | None:
    wanted = wearings_for(takes, effect, limits)
    if not wanted.further:
        return None
    wearings, each = wanted.names, len(wanted.take_names)
    following = ORDINALS[len(wearings)] if len(wearings) < len(ORDINALS) else f"{len(wearings) + 1}th"
    many = NUMBERS[len(wearings)] if len(wearings) < len(NUMBERS) else str(len(wearings))
    spoken = effect.name.replace("_", " ")
    why = (
        f"{many} wearings allow {_permutations(wanted.ways)} of their takes, a {spoken} needs"
        f" {wanted.needed} to be significant: record a {following} wearing with {each} takes"
    )
    what = (
        f"Take the glove off, put it on again and record {each} takes with the same motions as before;"
        f" name it as a {following} wearing."
    )
    record = asked_take(MORE_WEARINGS, what, _seconds(takes, each), (effect.name, CHANCE), each)
    return Undecidable(why, record, _of_wearings(wanted))


def _few_takes(
    takes: Sequence[Signals], effect: CorrectionEffect, limits: DiagnosisLimits
) -> Undecidable | None:
    levels = levels_for(takes, effect, limits)
    if levels is None or not levels.further:
        return None
    takes_so_far = f"{_counted(levels.takes, 'take')} with {_counted(levels.values, 'value')}"
    column, more_takes = levels.column, _more(levels.further)
    why = (
        f"{takes_so_far} of c.{column} allow {_permutations(levels.ways)}, {effect.name} needs"
        f" {levels.needed} to be significant: record {more_takes}, each at another value of c.{column}"
    )
    what = f"Record {more_takes} in free motion, each at another value of c.{column} than all before."
    seconds, separates = _seconds(takes, levels.further), (effect.name, CHANCE)
    record = asked_take(MORE_TAKES, what, seconds, separates, levels.further)
    return Undecidable(why, record, Wanted(levels.further, column=column))


def _more(takes: int) -> str:
    return _counted(takes, "more take")


def _permutations(count: int) -> str:
    return _counted(count, "permutation")


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"


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
    3,
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
        # What tells the second from the first may be another recording.
        turned = ((table.recording(b.name, a.name), a, b) for a, b in pairs)
        motion = next(
            (found for found, *both in turned if found and all(decides(e, found) for e in both)), None
        )
        if motion is None:
            return None
    motion = motion or _shown_by_one(known) or ANYTHING
    return asked_take(motion.name, motion.what, motion.seconds, tuple(rivals), motion.takes)


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


# Takes that are lacking, and one plan of them all.


def wanted_takes(
    takes: Sequence[Signals], effect: Effect, limits: DiagnosisLimits = DIAGNOSIS_LIMITS
) -> tuple[Wanted, ...]:
    """What ``takes`` lack for an effect to be judged; empty where they lack nothing, or no take would do."""
    why = why_not_shown(effect, takes)
    if isinstance(why, LackOfMotion):
        return (Wanted(why.motion.takes, why.motion),)
    if not isinstance(effect, CorrectionEffect):
        return ()
    if effect.comparison.control == "permuted wearings":
        wearings = wearings_for(takes, effect, limits)
        return (_of_wearings(wearings),) if wearings.further else ()
    levels = levels_for(takes, effect, limits) if effect.context else None
    return (Wanted(levels.further, column=levels.column),) if levels is not None and levels.further else ()


def wanted_movement(
    takes: Sequence[Signals], effect: Effect, limits: DiagnosisLimits = DIAGNOSIS_LIMITS
) -> tuple[Wanted, ...]:
    """Where the hand keeps still, or only its poses were recorded: movement, and what is lacking besides."""
    others = wanted_takes(takes, effect, limits)
    if kind_of(effect) == "nothing" or (not others and why_not_shown(effect, takes) is not None):
        return ()
    return (Wanted(_takes_of(limits.fewest_blocks, takes)), *others)


def _of_wearings(missing: Wearings) -> Wanted:
    return Wanted(len(missing.take_names), wearings=missing.further, names=missing.take_names)


def _takes_of(blocks: int, takes: Sequence[Signals]) -> int:
    return ceil(blocks / (_each_s(takes) // BLOCK_S))


def _each_s(takes: Sequence[Signals]) -> int:
    usual = float(np.median([take.time_s[-1] - take.time_s[0] for take in takes if len(take)] or [0.0]))
    return round(min(max(usual, PLANNED_S[0]), PLANNED_S[1]))


def _wanted_blocks(
    takes: Sequence[Signals], assessments: Sequence[Assessment], limits: DiagnosisLimits
) -> dict[str, tuple[Wanted, ...]]:
    """For every effect that was compared on fewer blocks than any verdict needs."""
    blocks = max((len(errors.base) for item in assessments for errors in item.errors), default=0)
    missing = limits.fewest_blocks - blocks
    if missing <= 0:
        return {}
    return {item.effect: (Wanted(_takes_of(missing, takes)),) for item in assessments}


def lacking_takes(
    takes: Sequence[Signals],
    impossible: Sequence[NotIdentifiable],
    assessments: Sequence[Assessment],
    limits: DiagnosisLimits,
    *,
    has_moved: bool,
) -> LackingTakes:
    """Of effects that ``takes`` cannot show, and of those compared on too little."""
    by_effect = {item.effect: item.wanted for item in impossible if item.wanted}
    by_effect |= _wanted_blocks(takes, assessments, limits)
    return LackingTakes(by_effect, _each_s(takes), has_moved)


@dataclass(frozen=True)
class LackingTakes:
    """All that takes lack, and how further ones are to be."""

    by_effect: Mapping[str, Sequence[Wanted]] = field(default_factory=dict)
    each_s: int = PLANNED_S[0]
    """Length of a take in free motion."""
    has_moved: bool = True
    """Whether the takes show movement that can be done again."""

    def plan(self, rivals: NextTake | None = None) -> TakePlan | None:
        """One plan for all effects, and for the recording that tells ``rivals`` apart; None where nothing is
        lacking. What opens an effect is the step after which it lacks nothing."""
        if rivals is not None and (CHANCE in rivals.separates or not rivals.is_take):
            rivals = None  # the same as what is lacking, or no take
        every = [item for each in self.by_effect.values() for item in each]
        steps = _steps(self.each_s, every, rivals, AS_BEFORE if self.has_moved else IN_FREE_MOTION)
        if not steps:
            return None
        opens = [list[str]() for _ in steps]
        for effect, each in self.by_effect.items():
            if each:
                opens[max(_place_of(item, steps) for item in each)].append(effect)
        columns = dict.fromkeys(item.column for item in every if item.column)
        return TakePlan(
            [replace(step, opens=tuple(names)) for step, names in zip(steps, opens, strict=True)],
            tuple(columns),
        )


NOTHING_LACKING = LackingTakes()


def _steps(
    each_s: int, wanted: Sequence[Wanted], rivals: NextTake | None, in_wearings: str
) -> list[PlannedTakes]:
    """First what tells rivals apart, then motions, free motion, further wearings, in which is done what
    ``in_wearings`` says."""
    steps: list[PlannedTakes] = []
    if rivals is not None:
        steps.append(PlannedTakes.of(rivals))
    for motion in dict.fromkeys(item.motion for item in wanted if item.motion is not None):
        if motion.name not in {step.motion for step in steps}:
            names = (motion.name.replace("_", "-"),) * motion.takes
            steps.append(PlannedTakes(names, round(motion.seconds / motion.takes), motion.name, motion.what))
    of_wearings = [item for item in wanted if item.wearings]
    further = max((item.wearings for item in of_wearings), default=0)
    in_each = max((item.names for item in of_wearings), key=len, default=())
    anywhere = max((item.takes for item in wanted if item.motion is None and not item.wearings), default=0)
    free = anywhere - sum(step.takes for step in steps) - further * len(in_each)
    if free > 0:
        steps.append(PlannedTakes((FREE_MOTION,) * free, each_s, MORE_TAKES, IN_FREE_MOTION))
    anew = PlannedTakes(in_each, each_s, MORE_WEARINGS, in_wearings, is_put_on_anew=True)
    return steps + [anew] * further


def _place_of(wanted: Wanted, steps: Sequence[PlannedTakes]) -> int:
    """Of the step with which it is there."""
    if wanted.motion is not None:
        return next(place for place, step in enumerate(steps) if step.motion == wanted.motion.name)
    if wanted.wearings:
        donnings = np.cumsum([step.is_put_on_anew for step in steps])
        return int(np.argmax(donnings >= wanted.wearings))
    return int(np.argmax(np.cumsum([step.takes for step in steps]) >= wanted.takes))
