"""What a diagnosis says with all of its rules, and without each that changed something.

Held-out errors are worked out once: a rule is left out of what follows the evidence it decides on. Where the
first name is right the takes are asked again beside that effect, as ``improve`` does: several rules only act
beside effects that a model has.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from blind_glove import BlindGlove
from diagnosis_answer import NOTHING, names_of, verdict

from glovecal_models.diagnosis.diagnose import asked, concluded
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.diagnosis.known_effect import KnownEffect
from glovecal_models.diagnosis.rules import ASSESSING, RULES, Rule, applied, states
from glovecal_models.diagnosis.state import Choices, State
from glovecal_models.effects.base.effect import IntervalEffect
from glovecal_models.effects.base.findings import FoundBefore
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits
from glovecal_models.layout import Layout
from glovecal_models.limit import with_limits
from glovecal_models.takes.take import Take

OFF: Mapping[str, Mapping[str, float]] = {
    "rare_share": {"rare_share": 9.0},
    "clear_share": {"clear_share": 9.0},
    "beside_known_rest_share": {"beside_known_rest_share": 9.0},
    "whole_least_share": {"whole_least_share": 0.0},
}
"""Limits that are a rule by themselves, with a value that switches them off."""
PLACE = {rule.name: number for number, rule in enumerate(RULES)}
AFTER = ("after", "rest", "settled", "unsettled", "healthy", "residual", "actions")
"""Fields of a state that depend on the first of its ranking alone."""


@dataclass(frozen=True)
class Ablation:
    """One diagnosis, and the same without each rule that changed something in it."""

    whole: Diagnosis
    """With all rules."""
    after: tuple[KnownEffect, ...]
    """The model's effects, and the first of the ranking."""
    without: dict[str, Diagnosis]
    """By the name of the rule, or of the limit that is switched off."""

    def to_document(self) -> dict[str, Any]:
        """Verdicts; without a rule only where that differs."""
        usual = _told(self.whole)
        others = {name: _told(found) for name, found in self.without.items()}
        return {
            "with": usual,
            "fired": [name for name in self.without if name not in OFF],
            "without": {name: told for name, told in others.items() if told != usual},
        }


def ablation(takes: Sequence[Take], layout: Layout, choices: Choices) -> Ablation:
    """As ``diagnose``, with all rules and without each that changes something."""
    start = asked(takes, layout, replace(choices, found_before=choices.found_before or FoundBefore()))
    passed = [start, *states(start)]
    whole = passed[-1]
    fired = {item.rule for state in passed for item in state.decided}
    without = {
        rule.name: concluded(_without(rule, passed))
        for rule in RULES
        if rule.name in fired and not rule.is_evidence
    }
    without |= {
        name: concluded(_with_limits(passed, values))
        for name, values in OFF.items()
        if name != "beside_known_rest_share" or choices.known
    }
    after = choices.known if whole.after is None else whole.after.known
    return Ablation(concluded(whole), after, without)


def ablation_answer(glove: BlindGlove, limits: ImprovementLimits = IMPROVEMENT_LIMITS) -> dict[str, Any]:
    """Verdicts by the glove's takes alone, and beside its first effect where that was named."""
    takes = glove.takes
    choices = Choices(linear=glove.linear, limits=limits.diagnosis, found_before=FoundBefore())
    alone = ablation(takes, glove.layout, choices)
    answer = {"alone": alone.to_document(), "right": names_of(glove), **glove.told()}
    known = _named(alone, glove)
    if known:
        answer["beside"] = ablation(takes, glove.layout, replace(choices, known=known)).to_document()
        answer["known"] = [item.effect.name for item in known]
    return answer


def _named(found: Ablation, glove: BlindGlove) -> tuple[KnownEffect, ...]:
    """The first effect as a model has it, where it is one of the glove's and can be part of a model."""
    first = _told(found.whole)["first"]
    if first == NOTHING or first not in {cause.name for cause in glove.causes}:
        return ()
    effect = found.whole.effects[first]
    if found.whole.signature or isinstance(effect, IntervalEffect):
        return (KnownEffect(effect, (), ()),) if isinstance(effect, IntervalEffect) else ()
    return tuple(item for item in found.after if item.effect.name == first)


def _told(found: Diagnosis) -> dict[str, Any]:
    return verdict(found) | {"alarm": found.residual.is_significant}


def _without(rule: Rule, passed: Sequence[State]) -> State:
    """The last state without a rule: what comes before it first decides is not worked out again."""
    place = next(
        number
        for number in range(len(RULES))
        if any(item.rule == rule.name for item in passed[number + 1].decided)
    )
    before = passed[place]
    question = replace(before.question, without=frozenset({rule.name}))
    again = PLACE["undecidable_first"] if rule in ASSESSING else place
    return _ended(replace(before, question=question), place, passed, max(again, PLACE[rule.name]))


def _with_limits(passed: Sequence[State], values: Mapping[str, float]) -> State:
    """The last state with other limits of verdicts on the same evidence."""
    place = PLACE["compare"] + 1
    before = passed[place]
    limits = with_limits(before.question.limits, values)
    items = tuple(replace(item, limits=with_limits(item.limits, values)) for item in before.assessments)
    begun = replace(
        before,
        question=replace(before.question, limits=limits),
        problem=replace(before.problem, limits=limits),
        assessments=items,
    )
    read_last = PLACE["whole_first" if "whole_least_share" in values else "undecidable_first"]
    return _ended(begun, place, passed, read_last)


def _ended(state: State, place: int, passed: Sequence[State], read_last: int) -> State:
    """The last state from one before the rule at a place. Once what was decided is the same as with all
    rules, and the rule that is left out is not asked any more (after ``read_last``), so is what follows."""
    left, judged = PLACE["leave_first"], PLACE["judge_residual"]
    number = place
    while number < len(RULES):
        if number == left and read_last < left and _first(state) == _first(passed[left]):
            # What is left after the first of the ranking is the same, whatever else was found.
            state = replace(state, **{name: getattr(passed[judged + 1], name) for name in AFTER})
            number = judged
        else:
            state = applied(RULES[number], state)
        number += 1
        if number > max(read_last, PLACE["rank"]) and _decided(state) == _decided(passed[number]):
            return passed[-1]
    return state


def _first(state: State) -> tuple[Any, ...]:
    first = state.naming.first
    named = () if first is None else (first.effect, first.significant_joints, id(first.shapes))
    return (*named, tuple((item.effect, item.saves_much) for item in state.not_identifiable))


def _decided(state: State) -> tuple[Any, ...]:
    """What later rules go by, beside the evidence."""
    return (
        _first(state),
        state.naming.confidence_set,
        [(item.effect, item.significant_joints, id(item.shapes)) for item in state.naming.ranked],
        state.findings,
        state.outweighed,
        state.signature,
        state.unsettled,
        state.healthy,
        state.by_column,
    )
