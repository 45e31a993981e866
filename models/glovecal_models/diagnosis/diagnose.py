"""Which physical effect is missing: from takes to a name, a confidence set, or a reason why none is named."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.comparison.noise_floor import takes_noise
from glovecal_models.diagnosis.camera_errors import camera_errors
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.diagnosis.forward_design import ForwardDesign
from glovecal_models.diagnosis.hold_drift import hold_drift
from glovecal_models.diagnosis.known_effect import KnownEffect
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.diagnosis.naming import Naming
from glovecal_models.diagnosis.next_take import (
    ONLY_POSE_NAMES,
    NotIdentifiable,
    hold_next_take,
    lacking_takes,
    next_take,
    take_to_decide,
)
from glovecal_models.diagnosis.problem import DiagnosisProblem
from glovecal_models.diagnosis.reference_problems import reference_problems
from glovecal_models.diagnosis.residual_answer import NextTake
from glovecal_models.diagnosis.rules import states
from glovecal_models.diagnosis.signatures import are_pose_labels
from glovecal_models.diagnosis.state import Choices, Question, State
from glovecal_models.diagnosis.unexplained_residual import UnexplainedResidual
from glovecal_models.effects.base.effect import Effect, is_between_takes, kind_of, needs_movement
from glovecal_models.effects.base.findings import FoundBefore
from glovecal_models.effects.base.relations import Motion
from glovecal_models.effects.base.signals import Signals
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
    declared, compared with the catalogue's. ``limits`` decide the verdicts. The others: as in ``Choices``.

    Raises BadInput, Cancelled.
    """
    begun = asked(
        takes,
        layout,
        Choices(
            linear=linear, known=tuple(known), effects=None if effects is None else tuple(effects),
            signatures=signatures, judge_residual=judge_residual, own=tuple(own), noise_floors=noise_floors,
            found_before=found_before, seed=seed, limits=limits, cancelled=cancelled, report=report,
        ),
    )  # fmt: skip
    if are_pose_labels(takes):
        return _of_pose_labels(begun)
    *_, ended = states(begun)
    begun.question.progress("done", 1.0)
    return concluded(ended)


def asked(takes: Sequence[Take], layout: Layout, choices: Choices) -> State:
    """The state before any rule. Raises BadInput, Cancelled."""
    stop_if(choices.cancelled, "the diagnosis")
    if choices.report:
        choices.report("preparing the takes", 0.0)
    problem = DiagnosisProblem.of(takes, layout, choices.linear, choices.known, choices.limits)
    design = problem.design()
    every = tuple(candidates(design.signals, choices.own))
    tried = every if choices.effects is None else choices.effects
    waiting = tuple(
        item for item in tried if problem.is_still or (problem.is_sparse and needs_movement(item))
    )
    is_measured, floors = not are_pose_labels(takes), choices.noise_floors
    if floors is None:
        floors = takes_noise(takes, problem.joints) if is_measured else {}
    question = Question(
        **vars(choices),
        takes=tuple(takes),
        layout=layout,
        catalogue=every,
        compared=tuple(item for item in tried if item not in waiting),
        waiting=waiting,
        by_name={item.name: item for item in (*every, *tried)},
        floors=dict(floors),
    )
    return State(
        question=question,
        problem=problem,
        design=design,
        beside=problem,
        screened=design,
        saved=problem.saved_by_known(design),
        has=frozenset(item.effect.name for item in choices.known),
        camera=camera_errors(problem, takes) if problem.has_camera and is_measured else None,
    )


def concluded(state: State) -> Diagnosis:
    """What a user is told of the state after all rules."""
    question, problem = state.question, state.problem
    apart_by = _apart_by(state)
    diagnosis = Diagnosis(
        joints=problem.joints,
        rmse_deg=_held_out_errors(state.design),
        noise_floors=dict(question.floors),
        naming=state.naming,
        assessments=state.assessments,
        not_identifiable=state.not_identifiable,
        reference_problems=reference_problems(
            question.takes, question.layout, question.limits, apart_by=apart_by
        ),
        findings=state.findings,
        signature=state.signature,
        residual=state.residual,
        next_take=None,
        lacking=lacking_takes(
            state.design.signals, state.not_identifiable, state.assessments,
            question.limits, has_moved=not (problem.is_still or problem.is_sparse),
        ),
        actions=state.actions,
        by_column=state.by_column,
        effects=question.by_name,
        linear=question.linear,
        limits=question.limits,
        camera=state.camera,
        decided=state.decided,
    )  # fmt: skip
    following = _next_take(diagnosis, question.by_name, state.screened.signals)
    following = following or take_to_decide(state.not_identifiable, state.residual)
    return replace(diagnosis, next_take=following)


def _apart_by(state: State) -> frozenset[str]:
    """Rotations whose takes may read differently at one angle: what is named, or what the model has, changes
    from take to take there. What would be named of more takes may act on every sensor."""
    ranked, known = state.naming.ranked[:1], state.question.known
    named = {item.joints[i] for item in ranked if item.p_value is not None for i in item.significant_joints}
    faint = {
        name
        for item in state.assessments
        if not ranked and item.p_value is not None and item.as_of_many_takes.significant_joints
        for name in item.joints
    }
    of_model = {name for item in known if is_between_takes(item.effect) for name in item.joints}
    return frozenset(named | faint | of_model)


def _next_take(
    diagnosis: Diagnosis, effects: Mapping[str, Effect], takes: Sequence[Signals]
) -> NextTake | None:
    """For what is told as the confidence set: what a signature names alone is repaired before rivals are."""
    found = {item.effect: item for item in diagnosis.naming.ranked}
    told = diagnosis.named

    def decides(effect: Effect, motion: Motion) -> bool:
        mine, comparison = found.get(effect.name), effect.comparison
        return mine is None or comparison is None or comparison.decided_by(motion, mine, takes)

    return next_take(told.confidence_set if told else (), effects, decides)


def _held_out_errors(design: ForwardDesign) -> dict[str, float]:
    return {name: float(np.sqrt(square)) for name, square in design.mean_square().items()}


def _of_pose_labels(state: State) -> Diagnosis:
    """Names of poses show no effect, but the drift of readings within held poses can be judged."""
    question, tried = state.question, (*state.question.compared, *state.question.waiting)
    drift = hold_drift(question.takes, question.layout.sensors, seed=question.seed, limits=question.limits)
    return Diagnosis(
        joints=state.design.rotations,
        rmse_deg=_held_out_errors(state.design),
        noise_floors={},
        naming=Naming(),
        assessments=(),
        not_identifiable=tuple(
            NotIdentifiable(item.name, ONLY_POSE_NAMES) for item in tried if kind_of(item) != "nothing"
        ),
        reference_problems=reference_problems(question.takes, question.layout, question.limits),
        findings=(),
        residual=UnexplainedResidual(obstacle="no measured angle"),
        next_take=hold_next_take(drift),
        effects={item.name: item for item in tried},
        hold_drift=drift,
        limits=question.limits,
    )
