"""The rules of a diagnosis, in the order in which they decide.

Evidence comes first: held-out errors of every effect beside its control. A rule takes the state and returns
it changed, with one sentence on what it changed; one that changes nothing returns the state it was given. The
list can be run without any rule that only decides, which shows what that rule is worth (docs/ablation.md).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.diagnosis.actions import Action, actions_for
from glovecal_models.diagnosis.camera_errors import within_camera
from glovecal_models.diagnosis.candidates import assessed, in_any_form, is_memory_of_known
from glovecal_models.diagnosis.naming import (
    Naming,
    also_found,
    is_beside_known,
    named,
    parts_of,
    saved_share_of,
    with_known_saved,
    with_other_share,
)
from glovecal_models.diagnosis.next_take import (
    SINGLE_POSES,
    STILL_HAND,
    NotIdentifiable,
    as_known,
    too_few,
    wanted_movement,
)
from glovecal_models.diagnosis.resampled import SMOOTHING
from glovecal_models.diagnosis.signatures import (
    are_held_levels,
    asked_last,
    is_asked_beside,
    is_outweighed,
    may_explain,
    own_sensors,
    signature_findings,
    weighed,
)
from glovecal_models.diagnosis.state import State
from glovecal_models.diagnosis.unexplained_residual import (
    UnexplainedResidual,
    healthy_beside,
    unexplained_residual,
    unsettled_effects,
    within_slip,
    without_unsettled,
)
from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.effect import Effect, RepairEffect, Weighed, has_memory, is_asked_last
from glovecal_models.effects.base.findings import Finding
from glovecal_models.effects.catalogue import relations


@dataclass(frozen=True)
class Rule:
    """One step of a diagnosis."""

    apply: Callable[[State], State]
    is_evidence: bool = False
    """Whether it works something out that others need: no diagnosis can do without it."""

    @property
    def name(self) -> str:
        return self.apply.__name__


# Which effects are asked for, and what each of them explains.


def residue_of_known(state: State) -> State:
    """What a correction leaves of an effect looks like its look-alikes: those are not asked for."""
    known = [item.effect.name for item in state.question.known]
    alike = [name for each in known for name in relations().alike_to(each) if name not in state.has]
    if not alike:
        return state
    why = "is not asked for: what a correction leaves of the model's effects looks like it."
    return state.because("residue_of_known", alike, f"{_listed(alike)} {why}", has=state.has.union(alike))


def compare(state: State) -> State:
    """Held-out errors of every effect beside its control."""
    asked = state.question
    generator = np.random.default_rng(asked.seed)
    found, impossible = assessed(state.screened, asked.compared, generator, state.has, asked.progress)
    why = STILL_HAND if state.problem.is_still else SINGLE_POSES
    takes, limits = state.design.signals, state.design.limits
    waiting = [
        NotIdentifiable(item.name, why, wanted=wanted_movement(takes, item, limits)) for item in asked.waiting
    ]
    return replace(state, assessments=tuple(found), not_identifiable=(*impossible, *waiting))


def still_rotations(state: State) -> State:
    """On a joint that hardly moves no effect is told from noise."""
    joints = state.design.rotations
    still = tuple(i for i, name in enumerate(joints) if name in state.problem.still)
    if not still:
        return state
    after = [replace(item, still=still) for item in state.assessments]
    return _assessed_anew(state, "still_rotations", after, "is not judged on {where}, which hardly moves")


def any_form(state: State) -> State:
    """A cause that changes from take to take may act in another form than its usual one."""
    generator = np.random.default_rng(state.question.seed)
    effects = state.question.by_name
    after = [in_any_form(state.screened, effects[item.effect], item, generator) for item in state.assessments]
    return _assessed_anew(
        state, "any_form", after, "saves enough of the error of {where} in another form than its usual one"
    )


def memory_of_known(state: State) -> State:
    """A memory of what the model's effects add at a joint is theirs, no second cause."""

    def judged(item: Assessment) -> Assessment:
        effect = state.question.by_name[item.effect]
        if item.p_value is not None or not any(map(len, item.weights)):
            return item
        of_known = (i for i in item.significant_joints if is_memory_of_known(state.screened, effect, i))
        return replace(item, of_known=tuple(of_known))

    return _assessed_anew(
        state, "memory_of_known", map(judged, state.assessments),
        "on {where} is a memory of what the model's effects add there, not of the joint's own motion",
    )  # fmt: skip


def form_of_known(state: State) -> State:
    """A named effect is right in its inputs and only nearly right in its form. What the form misses goes
    along with the same movements, so that another effect can grasp a part of it; a cause of its own saves
    more."""
    after = with_known_saved(state.assessments, state.saved)
    return _assessed_anew(
        state, "form_of_known", after,
        "on {where} saves no more than the form of the model's effects may leave",
    )  # fmt: skip


def memory_beside_memory(state: State) -> State:
    """What the form of one memory of the cloth misses looks like another one: that has to save more."""
    known = [item.effect for item in state.question.known]
    after = with_other_share(state.assessments, known, state.question.limits, mimics=True)
    return _assessed_anew(
        state, "memory_beside_memory", after,
        "on {where} saves no more than the form of a memory like it may leave",
    )  # fmt: skip


def delay_beside_memory(state: State) -> State:
    """What the forms of the model's effects miss hardly looks like a delay: that may save less."""
    known = [item.effect for item in state.question.known]
    after = with_other_share(state.assessments, known, state.question.limits, mimics=False)
    return _assessed_anew(
        state, "delay_beside_memory", after,
        "on {where} saves little, but more than the form of the model's effects leaves of its kind",
    )  # fmt: skip


def part_of_known(state: State) -> State:
    """Where the model has an effect that others seem to explain a part of, they have to explain more."""
    after = parts_of(state.assessments, state.question.wholes)
    return _assessed_anew(
        state, "part_of_known", after, "on {where} saves no more than a part of an effect that the model has"
    )


def camera(state: State) -> State:
    """What the camera that measured the angles may get wrong is no effect of the glove."""
    if state.camera is None:
        return state
    after = within_camera(state.assessments, state.camera, state.beside, state.screened)
    return _assessed_anew(
        state, "camera", after, "on {where} saves no more than the camera's own errors may explain"
    )


def healthy_slip(state: State) -> State:
    """Beside the model's effects, what changes from take to take is a further cause only where more is left
    of that than in a healthy glove, which slips a little."""
    between = [item for item in state.assessments if item.p_value is not None and item.significant_joints]
    if not any(item.joints for item in state.question.known) or not between:
        return state
    slips = set(within_slip(state.design))
    after = [
        replace(item, within_slip=tuple(i for i in item.significant_joints if i in slips))
        if item.p_value is not None
        else item
        for item in state.assessments
    ]
    return _assessed_anew(
        state, "healthy_slip", after, "on {where} is no more than a healthy glove's slow error"
    )


# Which of them comes first.


def rank(state: State) -> State:
    """The effect that saves most, and all that these takes cannot tell from it."""
    naming = named(state.assessments, state.question.limits)
    if naming.first is None:
        return replace(state, naming=naming)
    best, *rivals = naming.confidence_set
    ambiguous = f"; {_listed(rivals)} may leave as little error" if rivals else ""
    where = ", ".join(naming.first.joints[i] for i in naming.first.significant_joints)
    sentence = f"{best} on {where} saves most of the error{ambiguous}."
    return state.because("rank", naming.confidence_set, sentence, naming=naming)


def undecidable_first(state: State) -> State:
    """The error of an effect that these takes cannot decide, and that would save more than the one that is to
    be named, must not be attributed to another: the others are judged beside it."""
    first = state.naming.first
    likely = [item for item in state.not_identifiable if first and item.saved_square > first.saved_square]
    if not likely:
        return state
    beside = state.problem.beside(*(as_known(item, state.question.by_name) for item in likely))
    cannot = {item.effect for item in state.not_identifiable}
    others = tuple(item for item in state.question.compared if item.name not in cannot)
    before = tuple(item for item in state.decided if item.rule not in {rule.name for rule in ASSESSING})
    names = [item.effect for item in likely]
    again = replace(
        state, question=replace(state.question, compared=others), beside=beside, screened=beside.design(),
        decided=before,
    ).because(
        "undecidable_first", names,
        f"{_listed(names)} cannot be decided by these takes and would save more than any other effect: the"
        " others are judged beside it.",
    )  # fmt: skip
    for rule in ASSESSING:
        again = applied(rule, again)
    return replace(again, question=state.question, not_identifiable=state.not_identifiable)


def few_takes(state: State) -> State:
    """Where nothing is named, what would be if many takes showed as much: more are to be recorded."""
    if state.naming.first is not None:
        return state
    faint = [
        item
        for item in state.assessments
        if not item.significant_joints and item.as_of_many_takes.significant_joints
    ]
    if not faint:
        return state
    more = too_few(state.screened.signals, faint, state.question.limits)
    names = [item.effect for item in faint]
    sentence = f"{_listed(names)} may be there; these takes are too few to tell."
    return state.because("few_takes", names, sentence, not_identifiable=(*state.not_identifiable, *more))


def lookalikes(state: State) -> State:
    """Look-alikes of the first of the ranking in the order that they themselves decide."""
    naming, effects = state.naming, state.question.by_name
    leading = effects[naming.first.effect] if naming.first else None
    if leading is None or leading.comparison is None:
        return state
    alike = {leading.name, *relations().alike_to(leading.name)}
    decided = leading.comparison.first_of_alike(
        lambda smoothing: state.screened if smoothing == SMOOTHING else state.beside.design(smoothing)
    )
    members = [item for item in naming.ranked if item.effect in alike]
    if decided is None or decided[0] not in {item.effect for item in members}:
        return state
    first, possible = decided
    members.sort(key=lambda item: item.effect != first)
    others = [item for item in naming.ranked if item.effect not in alike]
    kept = [name for name in naming.confidence_set if name not in alike]
    after = Naming((*members, *others), (first, *(name for name in possible if name != first), *kept))
    if after.ranked == naming.ranked and after.confidence_set == naming.confidence_set:
        return state
    rest = [name for name in after.confidence_set if name != first]
    remain = f"{_listed(rest)} remain possible" if rest else "no other remains possible"
    return state.because(
        "lookalikes",
        after.confidence_set,
        f"The forms of the delay decide for {first}; {remain}.",
        naming=after,
    )


# What the recording shows by itself.


def look_for_signatures(state: State) -> State:
    """Effects that are known by a signature in the recording."""
    asked = state.question
    found = signature_findings(
        asked.takes, asked.layout, state.problem.joints, state.naming, state.lacking, asked.by_name,
        asked.known, asked.found_before, asked.limits,
    )  # fmt: skip
    is_asked = asked.signatures and not state.problem.is_still
    return replace(state, findings=tuple(found) if is_asked else ())


def slip_beside_known(state: State) -> State:
    """Beside a model's effects a slip is found only where it is larger than what they may have left, and
    where a larger slow error is left than in a healthy glove, which slips too."""
    effects, known = state.question.by_name, state.question.known
    if not known or not any(is_asked_last(effects[item.effect]) for item in state.findings):
        return state
    slips = {state.design.rotations[joint] for joint in within_slip(state.design)}
    share = state.design.limits.beside_known_share
    kept = tuple(
        item
        for item in state.findings
        if not is_asked_last(effects[item.effect])
        or (is_beside_known(item, state.saved, share) and not slips.issuperset(item.where))
    )
    lost = [item.effect for item in state.findings if item not in kept]
    if not lost:
        return state
    sentence = f"{_listed(lost)} is no larger than what the model's effects, or a healthy glove, may leave."
    return state.because("slip_beside_known", lost, sentence, findings=kept)


def part_of_finding(state: State) -> State:
    """One sensor fails, a glove slips as a whole: what an effect that is found at other sensors too may do to
    this one is no finding of its own."""
    sensor_of = own_sensors(state.question.layout, state.problem.joints)
    lost = [
        item
        for item in state.findings
        if any(
            other.effect in item.part_of
            and not {sensor_of.get(name, name) for name in other.where} <= {*item.where}
            for other in state.findings
        )
    ]
    if not lost:
        return state
    kept = tuple(item for item in state.findings if item not in lost)
    names = list(dict.fromkeys(item.effect for item in lost))
    wholes = list(dict.fromkeys(o.effect for o in kept if any(o.effect in item.part_of for item in lost)))
    sentence = (
        f"What {_listed(names)} was found by is a part of {_listed(wholes)}, found at other sensors too."
    )
    return state.because("part_of_finding", names, sentence, findings=kept)


def level_rivals(state: State) -> State:
    """One pass over known angles cannot tell what is found between them from some effects: both are named."""
    naming, findings = state.naming, state.findings
    if not findings or not are_held_levels(state.question.takes):
        return state
    found = findings[0].effect
    alike = relations().between_levels(found)
    if naming.first is None:
        names: Sequence[str] = (found, *alike)
    elif naming.first.effect in alike:
        names = (*naming.confidence_set, found)
    else:
        return state
    sentence = f"One pass over known angles cannot tell {_listed(names)} apart."
    return state.because("level_rivals", names, sentence, naming=replace(naming, confidence_set=tuple(names)))


def finding_rivals(state: State) -> State:
    """A finding that may be one of the ranked effects instead, where that saves error on the same rotations,
    and that effect are named together."""
    if not _has_signatures(state):
        return state
    joints = {item.joints[i] for item in state.naming.ranked for i in item.significant_joints}
    sensor_of = own_sensors(state.question.layout, sorted(joints))
    naming = also_found(state.naming, state.findings, sensor_of)
    return _with_rivals(state, "finding_rivals", naming, "was found where {first} saves error, and may be it")


def hidden_rivals(state: State) -> State:
    """What may be too small to be found, and is behind the first of the ranking: both are named.

    Steps of a column, and who explains more than such an effect could let others explain, are no chance.
    """
    naming, asked = state.naming, state.question
    first = naming.first
    if first is None or not _has_signatures(state):
        return state
    hidden = []
    for item in asked_last(state.lacking):
        if item.name in naming.confidence_set or not is_asked_beside(item, naming, asked.by_name):
            continue
        share = relations().whole(item.name).share
        if first.steps is None and saved_share_of(first) < share:
            against = _weighed(state, item, first)
            if against is not None and not against.needs_cause:
                hidden.append(item.name)
    return _with_rivals(
        state, "hidden_rivals", naming.also(hidden), "may be behind {first} and too small to be found"
    )


def outweighed(state: State) -> State:
    """What the first of a ranking saves is far more than the error where something was found."""
    found = {name: [item for item in state.findings if item.effect == name] for name in _repairs(state)}
    limits = state.question.limits
    names = [name for name, items in found.items() if is_outweighed(items, state.naming, limits)]
    if not names or state.naming.first is None:
        return state
    sentence = (
        f"{state.naming.first.effect} saves far more error than there is where {_listed(names)} was found."
    )
    return state.because("outweighed", names, sentence, outweighed=frozenset(names))


def repair_first(state: State) -> State:
    """What spoils the reference or the readings is repaired before rivals are compared."""
    for name in _repairs(state):
        if name not in state.outweighed:
            found = tuple(item for item in state.findings if item.effect == name)
            sentence = f"{name} is named first: it was found in the recording, and misleads what is compared."
            return state.because("repair_first", [name], sentence, signature=found)
    return state


def signature_alone(state: State) -> State:
    """Where nothing is ranked, what was found by its signature is named."""
    if state.signature or state.naming.ranked or not state.findings:
        return state
    name = state.findings[0].effect
    found = tuple(item for item in state.findings if item.effect == name)
    return state.because(
        "signature_alone",
        [name],
        f"{name} is named: no effect that was compared is significant.",
        signature=found,
    )


def whole_first(state: State) -> State:
    """An effect that others seem to explain a part of is named before them."""
    if state.signature or not state.naming.ranked:
        return state
    effects, naming, limits = state.question.by_name, state.naming, state.question.limits
    found: tuple[Finding, ...] = ()
    for name in _found(state):
        mine = [item for item in state.findings if item.effect == name]
        if relations().whole(name).parts and may_explain(effects[name], naming, mine, effects, limits):
            found = (*found, *mine)
    if not found:
        return state
    names = list(dict.fromkeys(item.effect for item in found))
    ranked = _listed([item.effect for item in naming.ranked])
    sentence = f"{_listed(names)} is named first: {ranked} may explain a part of it."
    return state.because("whole_first", names, sentence, signature=found)


def needless_parts(state: State) -> State:
    """Where these takes tell that what is named first is there and a ranked effect is not, that effect leaves
    the confidence set."""
    if not state.signature:
        return state
    first, naming = state.question.by_name[state.signature[0].effect], state.naming
    needless = [
        item.effect
        for item in naming.ranked
        if item.effect in naming.confidence_set
        and (against := _weighed(state, first, item)) is not None
        and against.is_instead
    ]
    if not needless:
        return state
    kept = tuple(name for name in naming.confidence_set if name not in needless)
    sentence = f"{first.name} alone makes these takes likely; it leaves nothing for {_listed(needless)}."
    return state.because("needless_parts", needless, sentence, naming=replace(naming, confidence_set=kept))


# What is left once the first of the ranking is added.


def leave_first(state: State) -> State:
    """The held-out residual with the first of the ranking in the base."""
    asked = state.question
    cannot_tell = state.problem.is_sparse or state.problem.is_still or are_held_levels(asked.takes)
    if not asked.judge_residual or cannot_tell:
        return state
    after = state.problem.with_first(state.naming.first, asked.by_name, state.design)
    rest = after.design()
    return replace(state, after=after, rest=rest, settled=rest)


def unsettled_start(state: State) -> State:
    """The unknown start of an effect that remembers is no unexplained error."""
    if state.after is None or state.rest is None:
        return state
    settled = without_unsettled(state.rest, state.after.known)
    if settled is state.rest:
        return state
    names = list(dict.fromkeys(item.effect.name for item in state.after.known if has_memory(item.effect)))
    sentence = f"Until {_listed(names)} has settled, the error of its unknown start is not judged."
    unsettled = unsettled_effects(state.rest, state.after.known)
    return state.because("unsettled_start", names, sentence, settled=settled, unsettled=unsettled)


def healthy_error(state: State) -> State:
    """Where an effect acts, an error of so few noise floors as a healthy glove's is explained."""
    if state.after is None or state.settled is None:
        return state
    healthy = healthy_beside(state.settled, state.after.known, state.question.floors)
    if not healthy:
        return state
    names = [item.effect.name for item in state.after.known if healthy.intersection(item.joints)]
    sentence = f"The error of {_listed(sorted(healthy))} is so few noise floors as a healthy glove's."
    return state.because("healthy_error", names, sentence, healthy=healthy)


def judge_residual(state: State) -> State:
    """Whether what is left exceeds a healthy glove's, and what it goes along with."""
    asked, after, rest = state.question, state.after, state.rest
    asked.progress("testing the residual", 0.95)
    if after is None or rest is None or state.settled is None:
        obstacle = "still hand" if state.problem.is_still else "single poses"
        return replace(
            state, residual=UnexplainedResidual(obstacle=obstacle if asked.judge_residual else None)
        )
    has = [item.effect.name for item in asked.known if item.joints]
    residual = unexplained_residual(
        state.settled, state.problem.even, asked.layout, asked.seed, floors=asked.floors,
        healthy=state.healthy, stated_deg={} if state.camera is None else state.camera.stated_deg,
    )  # fmt: skip
    residual = replace(
        residual,
        undecided=tuple(item.effect for item in state.not_identifiable if item.saves_much),
        unsettled=state.unsettled,
        after=tuple(dict.fromkeys((*has, *(item.effect for item in state.naming.ranked[:1])))),
    )
    there = {(item.effect.name, joint) for item in after.known for joint in item.joints}
    actions = actions_for(
        residual.associations, rest, asked.layout, there, linear=asked.linear, seed=asked.seed,
        saved_by_known=state.saved, wholes=asked.wholes,
    )  # fmt: skip
    return replace(state, residual=residual, actions=actions)


def own_column(state: State) -> State:
    """Where nothing else is named, and beside no other effect, whose form may have left as much: an effect
    whose own column the residual goes along with."""
    has = bool(state.saved) and bool(state.assessments)
    if state.naming.ranked or state.findings or has:
        return state
    found = [item for item in state.actions if item.saves and _is_own_column(state, item)]
    asked = tuple(item for item in found if item.effect == found[0].effect)
    if not asked:
        return state
    name = asked[0].effect or ""
    sentence = f"{name} is named: nothing else is, and the residual goes along with the column that it reads."
    return state.because("own_column", [name], sentence, by_column=asked)


ASSESSING = (
    Rule(compare, is_evidence=True),
    Rule(still_rotations),
    Rule(any_form),
    Rule(memory_of_known),
    Rule(form_of_known),
    Rule(memory_beside_memory),
    Rule(delay_beside_memory),
    Rule(part_of_known),
    Rule(camera),
    Rule(healthy_slip),
    Rule(rank, is_evidence=True),
)
RULES = (
    Rule(residue_of_known),
    *ASSESSING,
    Rule(undecidable_first),
    Rule(lookalikes),
    Rule(few_takes),
    Rule(look_for_signatures, is_evidence=True),
    Rule(slip_beside_known),
    Rule(part_of_finding),
    Rule(level_rivals),
    Rule(finding_rivals),
    Rule(hidden_rivals),
    Rule(outweighed),
    Rule(repair_first),
    Rule(signature_alone),
    Rule(whole_first),
    Rule(needless_parts),
    Rule(leave_first, is_evidence=True),
    Rule(unsettled_start),
    Rule(healthy_error),
    Rule(judge_residual, is_evidence=True),
    Rule(own_column),
)


def applied(rule: Rule, state: State) -> State:
    """The state after a rule; the same where the question leaves that out."""
    return state if rule.name in state.question.without else rule.apply(state)


def states(state: State, rules: Sequence[Rule] = RULES) -> Iterator[State]:
    """The state after each of ``rules``."""
    for rule in rules:
        state = applied(rule, state)
        yield state


def _found(state: State) -> list[str]:
    """Names of effects with a finding, in their order."""
    return list(dict.fromkeys(item.effect for item in state.findings))


def _repairs(state: State) -> list[str]:
    """Those that spoil reference or readings, and that nothing ranked may be instead."""
    effects, rivals = state.question.by_name, state.naming.confidence_set
    return [name for name in _found(state) if isinstance(effects[name], RepairEffect) and name not in rivals]


def _weighed(state: State, effect: Effect, ranked: Assessment) -> Weighed | None:
    asked = state.question
    return weighed(effect, ranked, asked.takes, asked.layout, asked.by_name, asked.known)


def _has_signatures(state: State) -> bool:
    return state.question.signatures and not are_held_levels(state.question.takes)


def _is_own_column(state: State, action: Action) -> bool:
    effect = state.question.by_name.get(action.effect or "")
    share = action.saved_share
    if effect is None or not action.is_physical or share is None:
        return False
    columns = [f"context {name}" for name in effect.context]
    return action.association.column in columns and share >= state.question.limits.own_column_share


def _assessed_anew(state: State, rule: str, after: Iterable[Assessment], what: str) -> State:
    """The state with other assessments; a decision where that changes joints on which one is significant.

    ``what``: the end of its sentence, with {where} for these joints.
    """
    items = tuple(after)
    changed = {
        item.effect: sorted({*item.significant_joints} ^ {*before.significant_joints})
        for before, item in zip(state.assessments, items, strict=True)
    }
    changed = {name: joints for name, joints in changed.items() if joints}
    state, joints = replace(state, assessments=items), state.design.rotations
    if not changed:
        return state
    said = [
        f"{name} {what.format(where=', '.join(joints[i] for i in where))}." for name, where in changed.items()
    ]
    return state.because(rule, list(changed), " ".join(said))


def _with_rivals(state: State, rule: str, naming: Naming, why: str) -> State:
    """The state with a wider confidence set."""
    names = [name for name in naming.confidence_set if name not in state.naming.confidence_set]
    if not names:
        return replace(state, naming=naming)
    first = naming.confidence_set[0]
    return state.because(rule, names, f"{_listed(names)} {why.format(first=first)}.", naming=naming)


def _listed(names: Sequence[str]) -> str:
    return ", ".join([*names[:-2], " and ".join(names[-2:])])
