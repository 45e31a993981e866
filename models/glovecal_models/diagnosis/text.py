"""What a diagnosis found, as it is answered: in sentences for people, from its results alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.text import model_effect
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.comparison.like_postures import OddTake
from glovecal_models.diagnosis.actions import Action, together
from glovecal_models.diagnosis.answer import (
    NOTHING_NAMED,
    FoundInRecording,
    MissingEffects,
    NotShown,
    RotationError,
    TakeSetAside,
)
from glovecal_models.diagnosis.camera_errors import CAMERA
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.diagnosis.hold_text import drift_in_holds, hold_sentence
from glovecal_models.diagnosis.next_take import SINGLE_POSES, STILL_HAND
from glovecal_models.diagnosis.residual_answer import (
    AssociatedColumn,
    FloorTimes,
    Remedy,
    Unexplained,
    explained,
    unplanned,
)
from glovecal_models.diagnosis.residual_association import ResidualAssociation
from glovecal_models.diagnosis.slow_error import FloorRatio
from glovecal_models.diagnosis.trial.answer import Candidate
from glovecal_models.diagnosis.unexplained_residual import SlowExcess, UnexplainedResidual
from glovecal_models.effects.base.assessment import Assessment, HeldOutRmse
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.catalogue import DeclaredEffect, relations
from glovecal_models.takes.take import Take
from glovecal_models.takes.take_check import excluded_sentences

MOST_ASSOCIATIONS = 3
UNITS = "The reference only names poses: errors are shares of the step from 0 to 1, not degrees."


def diagnosis_sentences(diagnosis: Diagnosis) -> list[str]:
    """What a mocap engineer should know, the most important first."""
    sentences = [*diagnosis.sensor_problems, *diagnosis.reference_problems, *camera_sentences(diagnosis)]
    sentences += [item.sentence for item in diagnosis.findings]
    if diagnosis.naming.ranked:
        sentences.append(ranked_sentence(diagnosis))
    elif diagnosis.by_column:
        sentences.append(by_column_sentence(diagnosis.by_column))
    elif diagnosis.hold_drift is not None:
        sentences += [hold_sentence(diagnosis.hold_drift), UNITS]
    elif not diagnosis.findings:
        sentences.append(nothing_named_sentence(diagnosis))
    sentences += [within_known_sentence(item) for item in diagnosis.assessments if item.within_known]
    sentences += [part_sentence(item) for item in diagnosis.assessments if item.part_of]
    sentences += [within_slip_sentence(item) for item in diagnosis.assessments if _is_within_slip(item)]
    following = unplanned(diagnosis.next_take, diagnosis.take_plan)
    if following is not None:
        sentences.append(following.sentence)
    sentences.append(residual_sentence(diagnosis.residual, None, diagnosis.by_column, diagnosis.actions))
    return sentences + undecided_sentences(diagnosis)


def camera_sentences(diagnosis: Diagnosis) -> list[str]:
    """What is the camera's: its errors, effects that it may explain as well, and the angles it did not
    see."""
    camera = diagnosis.camera
    if camera is None:
        return []
    within = [item for item in diagnosis.assessments if item.within_camera]
    sentences = [camera.sentence] if camera.joints else []
    sentences += [
        f"{item.effect} on {', '.join(item.joints[i] for i in item.within_camera)} is not named: the camera's"
        " own errors may explain as much."
        for item in within
    ]
    return [*sentences, *(item.sentence for item in camera.ranges)]


def named_sentence(diagnosis: Diagnosis) -> str | None:
    """Of the named effect; None when there is none."""
    named = diagnosis.named
    if named is not None and diagnosis.signature:
        others = ", ".join(named.confidence_set[1:])
        also = f" These takes cannot tell it from {others}." if others else ""
        return diagnosis.signature[0].sentence + also
    if diagnosis.naming.ranked:
        return ranked_sentence(diagnosis)
    if diagnosis.by_column:
        return by_column_sentence(diagnosis.by_column)
    held = diagnosis.hold_drift
    return None if held is None or not held.confidence_set else hold_sentence(held)


def ranked_sentence(diagnosis: Diagnosis) -> str:
    """The first of the ranking, with its evidence and its confidence set."""
    item = diagnosis.naming.ranked[0]
    where = ", ".join(item.joints[i] for i in item.significant_joints)
    start = f"{item.effect} on {where} explains {_explained(item.rmse_deg, item.p_value)}"
    rivals, comparison = diagnosis.naming.confidence_set[1:], diagnosis.effects[item.effect].comparison
    more = "" if comparison is None else comparison.consequence(item, diagnosis.naming.confidence_set)
    table = relations()
    method, unrecorded = (dict(rows).get(item.effect) for rows in (table.of_the_base, table.unrecorded))
    if diagnosis.linear and method is not None:
        better = f"The base is a straight line; one of --method {method} learns this by itself."
        more = f"{more} {better}".lstrip()
    if rivals:
        return f"{start}; ambiguous with {', '.join(rivals)}. {more}".rstrip()
    return f"{start}; {unrecorded}. {more}".rstrip() if unrecorded else f"{start}. {more}".rstrip()


def _explained(rmse: HeldOutRmse, p_value: float | None = None) -> str:
    return explained(rmse.before, rmse.after, rmse.control, p_value)


def by_column_sentence(actions: Sequence[Action]) -> str:
    """Of an effect that is named because the residual goes along with the column that measures its cause."""
    where = ", ".join(item.rotation for item in actions)
    return (
        f"{actions[0].effect} on {where} explains {_explained(together(actions))} in a form that these takes"
        " tell; no usual form of it does. The error goes along with"
        f" {actions[0].association.phrase}, which measures it."
    )


def nothing_named_sentence(diagnosis: Diagnosis) -> str:
    """Because nothing beats its control, the takes are too short, or the hand keeps still."""
    if STILL_HAND in {item.why for item in diagnosis.not_identifiable}:
        return f"No effect is judged: {STILL_HAND}."
    blocks = max((len(e.base) for item in diagnosis.assessments for e in item.errors), default=0)
    fewest = diagnosis.limits.fewest_blocks
    if blocks < fewest:
        return f"Too few data to judge any effect: {blocks} blocks of 5 s, {fewest} are needed."
    return NOTHING_NAMED


def within_known_sentence(item: Assessment) -> str:
    """Of an effect that is not named because the effects of the model may have left as much."""
    where = ", ".join(item.joints[i] for i in item.within_known)
    if set(item.within_known) <= set(item.of_known):
        return (
            f"{item.effect} on {where} is not named: a memory of what the model's effects add there leaves no"
            " more error than one of the joint's own motion."
        )
    return (
        f"{item.effect} on {where} is not named: it would save less than"
        f" {100 * item.limits.beside_known_share:.0f} % of the squared error that the model's effects save"
        " there, and the form of those may leave as much."
    )


def part_sentence(item: Assessment) -> str:
    """Of an effect that seems to explain a part of what the model has a wider interval for."""
    return (
        f"{item.effect} is not named: it would save too little of the error to be more than a part of"
        f" {item.part_of}, which the model has."
    )


def within_slip_sentence(item: Assessment) -> str:
    """Of an effect that changes from take to take no more than a healthy glove slips."""
    where = ", ".join(item.joints[i] for i in item.within_slip)
    return (
        f"{item.effect} is not named: the slow error of {where} is no larger than a healthy glove's, which"
        " slips a little."
    )


def _is_within_slip(item: Assessment) -> bool:
    return bool(item.within_slip) and not item.significant_joints


def candidate_sentence(item: Assessment) -> str:
    """What an effect and its control explain."""
    return (
        f"{item.effect} explains {_explained(item.rmse_deg)}; most on"
        f" {item.largest_contrast_joint}.{_in_steps(item)}"
    )


def _in_steps(item: Assessment) -> str:
    return "" if item.steps is None else f" It acts in equal steps of {item.steps.width:.3g} of its column."


def undecided_sentences(diagnosis: Diagnosis) -> list[str]:
    """What to record so that more can be judged, then why no take opens the other effects: one for each
    reason."""
    plan = diagnosis.take_plan
    reasons: dict[str, list[str]] = {}
    for item in diagnosis.not_identifiable:
        if plan is None or item.effect not in plan.opens:
            reasons.setdefault(item.why, []).append(item.effect)
    planned = [] if plan is None else [plan.heading, *plan.sentences]
    return planned + [
        f"Not identifiable: {', '.join(effects)}. Reason: {why}." for why, effects in reasons.items()
    ]


def residual_sentence(
    residual: UnexplainedResidual,
    is_noise: bool | None = None,
    by_column: Sequence[Action] = (),
    actions: Sequence[Action] = (),
) -> str:
    """Whether the residual is significant, and what it is associated with.

    ``is_noise``: whether every error that a reader sees beside it lies within its floor's interval; None: the
    residual's own errors. ``by_column``: of an effect that is named by it, and so still in it. ``actions``:
    what its associations ask for; where an effect pays on a rotation, it is not said that none explains it.
    """
    obstacle = residual_obstacle(residual)
    if obstacle is not None:
        return f"An unexplained residual cannot be judged: {obstacle}."
    if not residual.is_significant:
        return _not_significant(residual, is_noise)
    parts = [] if residual.excess is None else [_excess(residual.excess)]
    parts += [_above_floor(name, residual.floor_ratios[name]) for name in residual.above_floor[:1]]
    if residual.is_shared:
        shared = residual.shared
        parts.append(f"joints share an error of {shared.size_deg:.1f} degrees (p = {shared.p_value:.2g})")
    known = "identifiable effect" if residual.undecided else "known effect"
    start = f"No {known} explains {_rest(residual)}"
    if by_column:
        start = f"Until {by_column[0].effect} is added, its error is in the residual"
    elif paying := [item for item in actions if item.saves and item.is_physical and not item.is_within_known]:
        first = paying[0]
        start = f"On {first.rotation} {first.effect} explains a part of {_rest(residual)}"
    sentence = f"{start}: {' and '.join(parts)}; {_associated(residual.associations)}.{_unsettled(residual)}"
    undecided = " or ".join(residual.undecided)
    return (
        f"{sentence} Possible cause that these takes cannot decide: {undecided}." if undecided else sentence
    )


def _not_significant(residual: UnexplainedResidual, is_noise: bool | None) -> str:
    """Noise is only said of errors within their floors' intervals."""
    largest = max(item.size_deg for item in residual.judged)
    slow = f"slow errors (over 1 s) of at most {largest:.1f} degrees RMS"
    if residual.is_within_floors if is_noise is None else is_noise:
        return f"{_capital(_rest(residual))} looks like noise: {slow}.{_unsettled(residual)}"
    known = [item for item in residual.floor_ratios.values() if item.is_judgeable]
    times = (
        f"; errors of at most {max(item.times for item in known):.1f} times the noise floor" if known else ""
    )
    rest = _capital(_rest(residual))
    return f"{rest} is no larger than in healthy gloves: {slow}{times}.{_unsettled(residual)}"


def _rest(residual: UnexplainedResidual) -> str:
    """What is judged: where effects were added or named, what is left after them."""
    within = "what is left within takes" if residual.unsettled else "what is left"
    return f"{within} after {' and '.join(residual.after)}" if residual.after else "the residual"


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]


def _unsettled(residual: UnexplainedResidual) -> str:
    """What was not judged, as a further sentence; empty where all was."""
    names = residual.unsettled
    if not names:
        return ""
    remembers = f"{' and '.join(names)} {'remember' if names[1:] else 'remembers'}"
    return (
        f" Offsets of whole takes are not judged: {remembers} longer than these takes last, and what came"
        " before them was not recorded."
    )


def _above_floor(name: str, item: FloorRatio) -> str:
    return (
        f"the error of {name}'s readings is {item.rmse_deg:.2f} degrees, {item.times:.1f} times its noise"
        f" floor of {item.floor.floor_deg:.2f} (lower 95 % bound {item.lower_times:.1f}; healthy gloves: at"
        f" most {item.limits.healthy_floors:g})"
    )


def unexplained(
    found: UnexplainedResidual,
    is_noise: bool | None = None,
    by_column: Sequence[Action] = (),
    actions: Sequence[Action] = (),
) -> Unexplained:
    """As answers tell it. ``is_noise``: of the errors shown beside it; None: the residual's own."""
    return Unexplained(
        found.is_significant,
        residual_sentence(found, is_noise, by_column, actions),
        residual_obstacle(found),
        [
            AssociatedColumn(item.rotation, item.column, item.phrase, item.size_deg, item.p_value)
            for item in found.associations
        ],
        {
            name: FloorTimes(item.rmse_deg, item.times, item.lower_times, item.is_judgeable)
            for name, item in found.floor_ratios.items()
        },
    )


def residual_obstacle(residual: UnexplainedResidual) -> str | None:
    """Why the residual cannot be judged, as the end of a sentence; None where it can."""
    if residual.obstacle == "single poses":
        return SINGLE_POSES
    if residual.obstacle == "still hand":
        return STILL_HAND
    if residual.obstacle == "no measured angle":
        return "no angle was measured"
    if residual.obstacle == "few stretches":
        most = max((item.stretches for item in residual.slow.values()), default=0)
        limits = residual.limits
        return (
            f"{most} stretches of {limits.slow_shortest_s} s or more were measured,"
            f" {limits.slow_fewest_stretches} are needed"
        )
    excess = residual.excess
    if residual.obstacle is None or excess is None:
        return None
    return (
        f"the slow error of {excess.joint} (over 1 s) is {excess.error.size_deg:.1f} degrees RMS, lower 95 %"
        f" bound {excess.error.lower_bound_deg:.1f} from {excess.error.stretches} stretches; healthy gloves"
        f" have up to {excess.healthy_deg:.1f}; record longer takes"
    )


def _excess(item: SlowExcess) -> str:
    where = " within takes" if item.is_within_takes else ""
    return (
        f"slow error (over 1 s) of {item.joint}{where} {item.error.size_deg:.2f} degrees RMS (lower 95 %"
        f" bound {item.error.lower_bound_deg:.2f}; healthy gloves: at most {item.healthy_deg:.2f})"
    )


def _associated(columns: Sequence[ResidualAssociation]) -> str:
    if not columns:
        return "it is associated with none of the recorded columns"
    each = [
        f"{item.phrase} ({item.size_deg:.1f} degrees of {item.rotation}, p = {item.p_value:.2g})"
        for item in columns[:MOST_ASSOCIATIONS]
    ]
    return f"it is associated with {', '.join(each)}"


# Answers, from results.


def missing_effects(diagnosis: Diagnosis) -> MissingEffects:
    """Of the takes that were diagnosed."""
    held, camera, named = diagnosis.hold_drift, diagnosis.camera, diagnosis.named
    of_camera = (
        []
        if camera is None or not camera.joints
        else [FoundInRecording(CAMERA, "deviation", camera.joints, camera.sentence)]
    )
    return MissingEffects(
        rotations={
            name: _rotation(error, diagnosis.noise_floors.get(name))
            for name, error in diagnosis.rmse_deg.items()
        },
        named=None if named is None else replace(named, sentence=named_sentence(diagnosis) or ""),
        candidates=[candidate(item) for item in diagnosis.ranked_assessments],
        not_identifiable=[NotShown(item.effect, item.why) for item in diagnosis.not_identifiable],
        unexplained_residual=unexplained(diagnosis.residual, None, diagnosis.by_column, diagnosis.actions),
        next_take=diagnosis.next_take,
        take_plan=diagnosis.take_plan,
        sentences=diagnosis_sentences(diagnosis),
        findings=[
            *of_camera,
            *(
                FoundInRecording(item.effect, item.kind, item.where, item.sentence, item.stretches)
                for item in diagnosis.findings
            ),
        ],
        camera_ranges=() if camera is None else camera.ranges,
        sensor_problems=diagnosis.sensor_problems,
        reference_problems=diagnosis.reference_problems,
        hold_drift=None if held is None else drift_in_holds(held),
        actions=[remedy(item) for item in diagnosis.actions],
        decided=diagnosis.decided,
    )


def missing_in_model(
    diagnosis: Diagnosis,
    odd: Sequence[OddTake],
    model: CalibrationModel,
    takes: Sequence[Take],
    own: Sequence[Effect] = (),
) -> MissingEffects:
    """With the takes that were set aside of all ``takes``, what the model has, and the user's ``own``
    effects that were tried too."""
    return replace(
        missing_effects(diagnosis),
        odd_takes=[
            TakeSetAside(
                item.take, item.sentence, item.how, item.error_deg, item.usual_deg, item.fitted_deg,
                place=item.place,
            )
            for item in odd
            if item.is_set_aside
        ],
        excluded=excluded_sentences(takes),
        model_effects=[model_effect(item) for item in model.effects],
        declarations=[item.declaration.to_document() for item in own if isinstance(item, DeclaredEffect)],
    )  # fmt: skip


def _rotation(rmse_deg: float, floor: NoiseFloor | None) -> RotationError:
    return RotationError(rmse_deg, None if floor is None else floor.floor_deg, floor)


def candidate(item: Assessment) -> Candidate:
    rmse, errors = item.rmse_deg, list(zip(item.joints, item.errors, strict=True))
    return Candidate(
        effect=item.effect,
        where=[item.joints[i] for i in item.significant_joints],
        rmse_before_deg=rmse.before,
        rmse_after_deg=rmse.after,
        rmse_control_deg=rmse.control,
        saved_share={name: error.saved for name, error in errors},
        control_saved_share={name: error.control_saved for name, error in errors},
        p_value=item.p_value,
        passes=bool(item.significant_joints),
        sentence=candidate_sentence(item),
    )


def remedy(action: Action) -> Remedy:
    item, rmse = action.association, action.rmse_deg
    errors = (None, None, None) if rmse is None else (rmse.before, rmse.after, rmse.control)
    return Remedy(
        item.rotation, item.column, item.phrase, action.effect, action.is_physical, action.method, *errors,
        action.saves, action.is_within_known,
    )  # fmt: skip
