"""What became of additions and improvements in sentences for people, from their results alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from glovecal_models.calibration.text import dead_sensor_sentences, wearing_sentences
from glovecal_models.ceiling.text import ceiling_sentence, left_to_gain, not_left_to_gain
from glovecal_models.comparison.floor_estimate import NoiseFloor, floor_text
from glovecal_models.comparison.noise_floor import is_at_floor
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.diagnosis.hold_text import drift_in_holds, hold_sentence
from glovecal_models.diagnosis.text import (
    UNITS,
    nothing_named_sentence,
    ranked_sentence,
    residual_sentence,
    undecided_sentences,
    unexplained,
)
from glovecal_models.effects.base.effect import IntervalEffect
from glovecal_models.improvement.addition import Addition, total_rmse_deg
from glovecal_models.improvement.answer import ClaimCheck, EffectTried, Improved, ImprovementStep
from glovecal_models.improvement.improvement import Improvement, Trial

MOST_NAMED = 4


def addition_sentence(addition: Addition) -> str:
    """The held-out error, or the claim of the interval, before and after, and whether the effect stays."""
    if addition.claim is not None:
        return _interval_sentence(addition, addition.claim)
    name, gain = _on(addition.effect, addition.judged), 100 * addition.gain
    before, after = (total_rmse_deg(item, addition.judged) for item in (addition.before, addition.after))
    if addition.is_beaten_by_control and not addition.added:
        after = total_rmse_deg(addition.after, addition.rotations)
        return (
            f"{_on(addition.effect, addition.rotations)} was undone: its control leaves"
            f" {addition.control_rmse_deg:.2f} degrees of held-out error, less than its own {after:.2f}."
        )
    there = "" if addition.judges_all else " there"
    sentence = (
        f"{name} reduces the held-out error{there} from {before:.2f} to {after:.2f} degrees ({gain:.0f} %)."
        if addition.added
        else f"{name} was undone: held-out error{there} {before:.2f} degrees before, {after:.2f} after"
        f" ({gain:+.0f} % saved, {100 * addition.least_gain:.0f} % needed)."
    )
    if there and addition.added and addition.of_all_deg is not None:
        parent, child = addition.of_all_deg
        sentence += f" Over all rotations it was {parent:.2f} and is {child:.2f} degrees."
    if addition.left_out:
        sentence += f" It raises the error of {', '.join(addition.left_out)}, where it was left out."
    return sentence if addition.live is None else f"{sentence} {addition.live.sentence}"


def _interval_sentence(addition: Addition, claim: ClaimCheck) -> str:
    name = _on(addition.effect, addition.rotations)
    if not addition.added:
        return (
            f"{name} was undone: the claimed standard deviation does not become truer (held-out NLPD"
            f" {claim.nlpd_before:.3f} nats before, {claim.nlpd_after:.3f} after;"
            f" {claim.least_fall_nats} less is needed)."
        )
    short = "" if claim.is_truer else "; the takes are too short to show what a longer session does"
    return (
        f"{name}: {_what_widens(addition)}. Held-out NLPD {claim.nlpd_before:.2f} nats before,"
        f" {claim.nlpd_after:.2f} after{short}; the 95 % interval covers"
        f" {100 * claim.coverage_95_after:.0f} % of the measurements (before:"
        f" {100 * claim.coverage_95_before:.0f} %); the error stays at"
        f" {total_rmse_deg(addition.before, addition.rotations):.2f} degrees."
    )


def _what_widens(addition: Addition) -> str:
    added = next(item for item in addition.model.effects if item.name == addition.effect)
    effect = added.effect
    assert isinstance(effect, IntervalEffect)
    return effect.sentence(added.settings, addition.rotations)


def _on(effect: str, rotations: Sequence[str]) -> str:
    where = ", ".join(rotations) if len(rotations) <= MOST_NAMED else f"{len(rotations)} rotations"
    return f"{effect} on {where}"


def improvement_sentences(improvement: Improvement) -> list[str]:
    """What happened in order, and what remains."""
    last, usable = improvement.diagnosis, improvement.usable_sensors
    sentences = [*(last.reference_problems if last else ()), *improvement.take_warnings]
    if usable is not None:
        sentences += dead_sensor_sentences(usable, usable.layout.rotations)
    if improvement.only_take_s is not None:
        sentences.append(
            f"There is only one take, of {improvement.only_take_s:.0f} s: errors are on held-out pieces"
            " of it and say nothing about another take or wearing. Record a second one."
        )
    final = improvement.steps[-1]
    sentences = [*wearing_sentences(final.model, final.rmse_seen_wearing_deg), *sentences]
    for trial in improvement.trials:
        sentences += [item for item in _trial_sentences(trial) if item not in sentences]
    if last is not None:
        sentences += _closing_sentences(last, improvement)
    if improvement.ceiling is not None:
        sentences.append(ceiling_sentence(improvement.ceiling))
    return sentences


def _trial_sentences(trial: Trial) -> list[str]:
    effect, found = trial.addition.effect, trial.diagnosis
    sentences = [*trial.reasons, addition_sentence(trial.addition)]
    sentences += [f"{name} is redundant beside {effect} and was removed." for name in trial.removed]
    ranked = found.naming.ranked if found is not None else ()
    if found is not None and trial.addition.added and ranked and ranked[0].effect == effect:
        sentences.append(ranked_sentence(found))
    return sentences


def is_noise(improvement: Improvement) -> bool:
    """Whether every error of the last step lies within the interval of its floor."""
    errors, floors = improvement.steps[-1].per_rotation, improvement.noise_floor
    return all(is_at_floor(error, floors.get(name)) for name, error in errors.items())


def _closing_sentences(diagnosis: Diagnosis, improvement: Improvement) -> list[str]:
    """What was found beside the added effects, what could not be judged, and what remains."""
    last, floors = improvement.steps[-1], improvement.noise_floor
    held = diagnosis.hold_drift
    sentences = [] if held is None else [hold_sentence(held), UNITS]
    sentences += [item.sentence for item in diagnosis.findings]
    if held is None and not diagnosis.findings and not diagnosis.naming.ranked:
        sentences.append(nothing_named_sentence(diagnosis))
    sentences += undecided_sentences(diagnosis)
    sentences.append(residual_sentence(diagnosis.residual, is_noise(improvement), actions=diagnosis.actions))
    if diagnosis.residual.is_significant:
        sentences += not_left_to_gain(improvement.ceiling)
    if held is None:
        sentences += [*_repeatability_sentences(floors), _remaining_sentence(last.per_rotation, floors)]
    return sentences


def _remaining_sentence(per_rotation: Mapping[str, float], floors: Mapping[str, NoiseFloor]) -> str:
    """``per_rotation``: errors (deg) of the last step; the largest first."""
    worst = sorted(per_rotation, key=lambda name: -per_rotation[name])
    each = ", ".join(
        f"{per_rotation[name]:.2f} on {name} ({_floor(floors.get(name))})" for name in worst[:MOST_NAMED]
    )
    more = f" and less on {len(worst) - MOST_NAMED} more" if len(worst) > MOST_NAMED else ""
    return f"Remaining held-out error in degrees: {each}{more}."


def _floor(floor: NoiseFloor | None) -> str:
    return "noise floor unknown" if floor is None else f"noise floor {floor_text(floor)}"


def _repeatability_sentences(floors: Mapping[str, NoiseFloor]) -> list[str]:
    """How well single poses repeat; none where that was measured in another way."""
    found = {name: floor for name, floor in floors.items() if floor.how == "near readings"}
    if not found:
        return []
    worst = sorted(found, key=lambda name: -found[name].floor_deg)[:MOST_NAMED]
    each = ", ".join(f"{found[name].floor_deg:.1f} on {name}" for name in worst)
    return [
        f"Repeatability of the reference in degrees: {each}. Frames with nearly the same readings differ"
        " by so much, and no model of these takes can have a smaller error."
    ]


# Answers, from results.


def effect_tried(found: Addition) -> dict[str, Any]:
    """The fields of ``EffectTried``, by name."""
    return {
        "effect": found.effect,
        "where": found.rotations,
        "added": found.added,
        "sentence": addition_sentence(found),
        "before": {name: found.before.rmse_deg(name) for name in found.rotations},
        "after": {name: found.after.rmse_deg(name) for name in found.rotations},
        "parameters": found.parameters,
        "curves": found.curves,
        "claim": found.claim,
        "declaration": found.declaration,
    }


def improved(found: Improvement) -> Improved:
    """Before its models are stored."""
    last, floors = found.diagnosis, found.noise_floor
    held = None if last is None else last.hold_drift
    return Improved(
        steps=[
            ImprovementStep(
                None, step.added, step.rmse_deg, step.per_rotation, step.control_rmse_deg,
                step.rmse_unseen_wearing_deg,
            )
            for step in found.steps
        ],
        noise_floor_deg={name: floor.floor_deg for name, floor in floors.items()},
        stopped=found.stopped,
        undone=[EffectTried(**effect_tried(item)) for item in found.undone],
        next_take=found.next_take,
        take_plan=None if last is None else last.take_plan,
        sentences=improvement_sentences(found),
        baselines=found.baselines,
        noise_floor_interval_deg={name: [floor.low_deg, floor.high_deg] for name, floor in floors.items()},
        noise_floors=floors,
        hold_drift=None if held is None else drift_in_holds(held),
        unexplained_residual=None if last is None else unexplained(
            last.residual, is_noise(found), actions=last.actions
        ),
        ceiling=None if found.ceiling is None else left_to_gain(found.ceiling),
        method=found.models[0].method,
        subject=found.models[0].subject,
    )  # fmt: skip
