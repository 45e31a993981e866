"""Which physical effect is missing: from takes to a name, a confidence set, or a reason why none is named."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.comparison.noise_floor import takes_noise
from glovecal_models.diagnosis.actions import Action, actions_for
from glovecal_models.diagnosis.camera_errors import beside_camera, camera_errors
from glovecal_models.diagnosis.candidates import assessed
from glovecal_models.diagnosis.confidence_set import beside_findings, beside_hidden, beside_levels
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.diagnosis.forward_design import ForwardDesign
from glovecal_models.diagnosis.hold_drift import hold_drift
from glovecal_models.diagnosis.known_effect import KnownEffect
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.diagnosis.naming import Naming, beside_known, beside_wholes, is_beside_known, named
from glovecal_models.diagnosis.next_take import NextTake, hold_next_take, next_take
from glovecal_models.diagnosis.not_identifiable import (
    ONLY_POSE_NAMES,
    SINGLE_POSES,
    NotIdentifiable,
    as_known,
    exceeding_named,
    take_to_decide,
)
from glovecal_models.diagnosis.posed_holds import are_pose_labels
from glovecal_models.diagnosis.problem import DiagnosisProblem
from glovecal_models.diagnosis.reference_problems import reference_problems
from glovecal_models.diagnosis.resampled import SMOOTHING
from glovecal_models.diagnosis.signatures import are_held_levels, signature_findings
from glovecal_models.diagnosis.unexplained_residual import (
    UnexplainedResidual,
    unexplained_residual,
    within_slip,
)
from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.facts import Motion
from glovecal_models.effects.base.signature_effect import Finding, FoundBefore
from glovecal_models.effects.catalogue import candidates
from glovecal_models.layout import Layout
from glovecal_models.progress import Cancel, Report, stop_if
from glovecal_models.takes.take import Take


def diagnose(
    takes: Sequence[Take],
    layout: Layout,
    *,
    linear: bool = False,
    known: Sequence[KnownEffect] = (),
    effects: Sequence[Effect] | None = None,
    signatures: bool = True,
    judge_residual: bool = True,
    own: Sequence[Effect] = (),
    noise_floors: Mapping[str, NoiseFloor] | None = None,
    found_before: FoundBefore | None = None,
    seed: int = 0,
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS,
    cancelled: Cancel | None = None,
    report: Report | None = None,
) -> Diagnosis:
    """``known``: effects the model has already; they are part of the base. ``own``: effects that the user
    declared, compared with the catalogue's. ``limits`` decide the verdicts.

    Without ``signatures`` and ``judge_residual`` only the naming is worked out, in less time.
    ``noise_floors``: of these takes, where they were measured before; None: they are measured.
    ``found_before``: signatures that were looked for before.

    Raises BadInput, Cancelled.
    """

    def progress(text: str, share: float) -> None:
        stop_if(cancelled, "the diagnosis")
        if report:
            report(text, share)

    progress("preparing the takes", 0.0)
    problem = DiagnosisProblem.of(takes, layout, linear, known, limits)
    design = problem.design()
    every = candidates(design.signals, own)
    tried = every if effects is None else list(effects)
    by_name = {item.name: item for item in (*every, *tried)}
    if are_pose_labels(takes):
        return _of_pose_labels(takes, layout, design, tried, seed, limits)
    if noise_floors is None:
        noise_floors = takes_noise(takes, problem.joints)
    has = _has(known)
    waiting = [item for item in tried if problem.is_sparse and item.needs_movement]
    judged = [item for item in tried if item not in waiting]
    found, impossible = assessed(design, judged, np.random.default_rng(seed), has, progress)
    saved = problem.saved_by_known(design)
    seen = camera_errors(problem, takes) if problem.has_camera else None
    has_effects = [item.effect for item in known]
    has_names = [item.effect.name for item in known if item.joints]
    wholes = [item for item in has_effects if item.also_explained_by]
    found = beside_wholes(beside_known(found, saved, has_effects, limits), wholes)
    if seen is not None:
        found = beside_camera(found, seen, problem, design)
    found = _beside_slip(found, design, known)
    naming, beside, screened = named(found, limits), problem, design
    undecided = exceeding_named(impossible, naming)
    if undecided:
        # Their error must not be attributed to another effect: the others are assessed beside them.
        beside = problem.beside(*(as_known(item, judged) for item in undecided))
        others = [item for item in judged if item.name not in {each.effect for each in impossible}]
        screened = beside.design()
        found, _ = assessed(screened, others, np.random.default_rng(seed), has, progress)
        found = beside_wholes(beside_known(found, saved, has_effects, limits), wholes)
        if seen is not None:
            found = beside_camera(found, seen, beside, screened)
        found = _beside_slip(found, design, known)
        naming = named(found, limits)
    impossible += [NotIdentifiable(item.name, SINGLE_POSES) for item in waiting]
    naming = _with_alikes_ordered(naming, beside, screened, by_name)
    lacking = [item for item in every if item.name not in has]
    asked = signature_findings(takes, layout, problem.joints, naming, lacking, by_name, known, found_before)
    findings = tuple(asked) if signatures else ()
    if known and any(by_name[item.effect].stage == "last" for item in findings):
        findings = _last_beside_known(findings, design, saved, by_name)
    naming = beside_levels(naming, takes, findings, by_name)
    if signatures and not are_held_levels(takes):
        naming = beside_findings(naming, findings, layout)
        naming = beside_hidden(naming, takes, layout, lacking, by_name, known)
    progress("testing the residual", 0.95)
    actions: tuple[Action, ...] = ()
    if not judge_residual:
        residual = UnexplainedResidual()
    elif problem.is_sparse or are_held_levels(takes):
        residual = UnexplainedResidual(obstacle="single poses")
    else:
        after = problem.with_first(naming, by_name, design)
        rest = after.design()
        likely = [item.effect for item in impossible if item.saves_much]
        residual = unexplained_residual(
            rest, problem.even, layout, seed, known=after.known, floors=noise_floors, undecided=likely,
            stated_deg={} if seen is None else seen.stated_deg,
        )  # fmt: skip
        residual = replace(
            residual,
            after=tuple(dict.fromkeys((*has_names, *(item.effect for item in naming.ranked[:1])))),
        )
        there = {(item.effect.name, joint) for item in after.known for joint in item.joints}
        actions = actions_for(
            residual.associations, rest, layout, there, linear=linear, seed=seed, saved_by_known=saved,
            wholes=wholes,
        )  # fmt: skip
    progress("done", 1.0)
    problems = reference_problems(takes, layout, limits, apart_by=_apart_by(naming, known))
    diagnosis = Diagnosis(
        joints=problem.joints,
        rmse_deg=_held_out_errors(design),
        noise_floors=dict(noise_floors),
        naming=naming,
        assessments=tuple(found),
        not_identifiable=tuple(impossible),
        reference_problems=problems,
        findings=findings,
        residual=residual,
        next_take=None,
        actions=actions,
        effects=by_name,
        linear=linear,
        limits=limits,
        camera=seen,
    )
    asked = _next_take(diagnosis, by_name, takes) or take_to_decide(impossible, residual)
    return replace(diagnosis, next_take=asked)


def _beside_slip(
    found: Sequence[Assessment], design: ForwardDesign, known: Sequence[KnownEffect]
) -> list[Assessment]:
    """The same, where the model has effects: what changes from take to take is a further cause only where
    more is left of that than in a healthy glove."""
    between_takes = [item for item in found if item.p_value is not None and item.significant_joints]
    if not any(item.joints for item in known) or not between_takes:
        return list(found)
    slips = set(within_slip(design))
    return [
        replace(item, within_slip=tuple(i for i in item.significant_joints if i in slips))
        if item.p_value is not None
        else item
        for item in found
    ]


def _last_beside_known(
    findings: Sequence[Finding],
    design: ForwardDesign,
    saved: Mapping[str, float],
    effects: Mapping[str, Effect],
) -> tuple[Finding, ...]:
    """The same; what is asked for last is found beside a model's effects only where it is larger than what
    they may have left, and where a larger slow error is left than in a healthy glove, which slips too."""
    slips = {design.rotations[joint] for joint in within_slip(design)}
    return tuple(
        item
        for item in findings
        if effects[item.effect].stage != "last"
        or (
            is_beside_known(item, saved, design.limits.beside_known_share)
            and not slips.issuperset(item.where)
        )
    )


def _apart_by(naming: Naming, known: Sequence[KnownEffect]) -> frozenset[str]:
    """Rotations whose takes may read differently at one angle: what is named, or what the model has, changes
    from take to take there."""
    first = naming.ranked[:1] if naming.ranked and naming.ranked[0].p_value is not None else ()
    named_there = {item.joints[i] for item in first for i in item.significant_joints}
    known_there = {name for item in known if item.effect.changes_between_takes for name in item.joints}
    return frozenset(named_there | known_there)


def _next_take(diagnosis: Diagnosis, effects: Mapping[str, Effect], takes: Sequence[Take]) -> NextTake | None:
    """For what is told as the confidence set: what a signature names alone is repaired before rivals are."""
    found = {item.effect: item for item in diagnosis.naming.ranked}
    told = diagnosis.named

    def decides(effect: Effect, motion: Motion) -> bool:
        return effect.name not in found or effect.decided_by(motion, found[effect.name], takes)

    return next_take(told.confidence_set if told else (), effects, decides)


def _has(known: Sequence[KnownEffect]) -> set[str]:
    """The known effects, and those that their residue resembles."""
    return {name for item in known for name in (item.effect.name, *item.effect.alike)}


def _with_alikes_ordered(
    naming: Naming, problem: DiagnosisProblem, design: ForwardDesign, effects: Mapping[str, Effect]
) -> Naming:
    """The ranking with look-alikes of its first put in the order that they themselves decide.

    ``design`` is that of ``problem`` at the usual smoothing.
    """
    leading = effects[naming.ranked[0].effect] if naming.ranked else None
    if leading is None or not leading.alike:
        return naming
    alike = {leading.name, *leading.alike}
    decided = leading.told_from_alikes(
        lambda smoothing: design if smoothing == SMOOTHING else problem.design(smoothing)
    )
    members = [item for item in naming.ranked if item.effect in alike]
    if decided is None or decided[0] not in {item.effect for item in members}:
        return naming
    first, possible = decided
    members.sort(key=lambda item: item.effect != first)
    others = [item for item in naming.ranked if item.effect not in alike]
    kept = [name for name in naming.confidence_set if name not in alike]
    return replace(
        naming,
        ranked=(*members, *others),
        confidence_set=(first, *(name for name in possible if name != first), *kept),
    )


def _held_out_errors(design: ForwardDesign) -> dict[str, float]:
    return {name: float(np.sqrt(square)) for name, square in design.mean_square().items()}


def _of_pose_labels(
    takes: Sequence[Take],
    layout: Layout,
    design: ForwardDesign,
    tried: Sequence[Effect],
    seed: int,
    limits: DiagnosisLimits,
) -> Diagnosis:
    """Names of poses show no effect, but the drift of readings within held poses can be judged."""
    drift = hold_drift(takes, layout.sensors, seed=seed, limits=limits)
    return Diagnosis(
        joints=design.rotations,
        rmse_deg=_held_out_errors(design),
        noise_floors={},
        naming=Naming((), ()),
        assessments=(),
        not_identifiable=tuple(
            NotIdentifiable(item.name, ONLY_POSE_NAMES) for item in tried if item.stage != "never"
        ),
        reference_problems=reference_problems(takes, layout, limits),
        findings=(),
        residual=UnexplainedResidual(obstacle="no measured angle"),
        next_take=hold_next_take(drift),
        effects={item.name: item for item in tried},
        hold_drift=drift,
        limits=limits,
    )
