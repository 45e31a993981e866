"""Sentences about training: which samples, sensors and weights a model was trained with; its effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.calibration.answer import ModelEffect
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.order_confounding import OrderConfounding
from glovecal_models.calibration.training_plan import TrainingPlan, UsableSensors
from glovecal_models.calibration.unseen_wearing import UnseenWearing
from glovecal_models.effects.base.effect import has_memory
from glovecal_models.effects.catalogue import wearing_effect

COUNTED_BY = ("lmc_gpr", "linear", "two_shapes")
"""Methods in which a stated deviation is a sample's noise."""


def plan_sentences(plan: TrainingPlan) -> list[str]:
    """How the samples were chosen, and which rotations the model does not have."""
    largest = max(len(task.target) for task in plan.tasks if task.fold is None)
    takes = f"{plan.take_count} take{'' if plan.take_count == 1 else 's'}"
    sentences = [
        f"{takes}, {plan.frame_count} frames; at most {largest} samples per rotation, spread evenly over "
        "readings, angles and takes."
    ]
    if plan.rules:
        sentences.append(f"Not measured, computed by the layout's rule: {', '.join(plan.rules)}.")
    missing = [name for name in plan.unmeasured if name not in plan.rules]
    if missing:
        sentences.append(f"Not measured, not in the model: {', '.join(missing)}.")
    sentences += [
        f"{name} was measured at {angle:g} degrees only: not in the model until there is another angle."
        for name, angle in plan.only_angle_deg.items()
    ]
    if plan.unshown:
        sentences.append(f"Not in both shapes, not in the model: {', '.join(plan.unshown)}.")
    sentences += _camera_sentences(plan)
    return [*sentences, *dead_sensor_sentences(plan.usable, plan.unreadable)]


def _camera_sentences(plan: TrainingPlan) -> list[str]:
    """Which angles a camera saw, and what it adds to the held-out errors."""
    stated = [item.sd_deg for item in plan.camera_ranges if item.sd_deg is not None]
    if not stated:
        return [item.sentence for item in plan.camera_ranges]
    rms = sum(sd**2 for sd in stated) ** 0.5 / len(stated) ** 0.5
    start = (
        f"A camera measured {len(stated)} rotations; samples count by its stated deviation"
        f"{'' if plan.settings.method in COUNTED_BY else f' (not by method {plan.settings.method})'}. "
        f"Held-out errors contain its own, {rms:.1f} degrees (RMS)."
    )
    return [start, *(item.sentence for item in plan.camera_ranges)]


def dead_sensor_sentences(usable: UsableSensors, rotations: Sequence[str]) -> list[str]:
    """Which sensors are dead, and which of ``rotations`` no other sensor measures."""
    if not usable.dead:
        return []
    several = "s" * (len(usable.dead) > 1)
    sentences = [
        f"Dead sensor{several} in these takes: {', '.join(map(str, usable.dead))}. Not used in training; "
        "rotations are read from the others. Is a wire broken?"
    ]
    lost = [name for name in usable.unreadable if name in rotations]
    if lost:
        sentences.append(f"No working sensor measures {', '.join(lost)}: not in the model.")
    return sentences


def order_sentences(found: Sequence[OrderConfounding]) -> list[str]:
    """One for each wearing in which the order of the session and its postures cannot be told apart."""
    sentences = []
    for wearing in dict.fromkeys(item.wearing for item in found if item.is_confounded):
        own = [item for item in found if item.is_confounded and item.wearing == wearing]
        each = ", ".join(f"{item.rotation} {item.r2:.2f}" for item in own)
        shifted = max(item.shifted_r2 for item in own)
        several = len(own) > 1
        sentences.append(
            f"In {wearing} posture goes with time: R2 of time by angle is {each}; 95 % of circularly "
            f"shifted sessions stay below {shifted:.2f}. A drift of the readings would look like posture "
            f"there. Add a take with {'these rotations' if several else 'it'} in random order (glovecal "
            "sample asks so), or up and down again."
        )
    return sentences


def weight_sentence(rotation: str, evidence: Mapping[str, Any]) -> str | None:
    """Why samples were weighted; None where no weights were tried."""
    errors = evidence.get("held_out_rmse_deg")
    if not errors:
        return None
    ratio = evidence.get("effective_sample_ratio", evidence.get("independent_share"))
    tried = ", ".join(f"{error:.2f} degrees at {name}" for name, error in errors.items())
    return (
        f"{rotation}: errors are autocorrelated (effective sample ratio {ratio:.2f}), so something that its "
        f"sensors do not read may affect it. Samples weighted {evidence['sample_weight']:g}: smallest "
        f"held-out error ({tried})."
    )


def wearing_sentences(model: CalibrationModel, seen_deg: float | None) -> list[str]:
    """The error in a wearing not seen, then that in wearings seen (``seen_deg``), and what to do.

    None for a model of before this was estimated.
    """
    found = model.unseen_wearing
    if found is None:
        return []
    if found.rmse_deg is None or found.interval_deg is None:
        return _not_estimated(found)
    low, high = found.interval_deg
    sentences = [
        f"In a wearing not seen: {found.rmse_deg:.2f} degrees ({len(found.per_wearing)} wearings, each left "
        f"out whole; 95 % interval {low:.1f} to {high:.1f})."
    ]
    if seen_deg is not None:
        sentences.append(f"In the wearings seen: {seen_deg:.2f} degrees (takes left out).")
    if found.is_much_worse_than(seen_deg):
        sentences.append(_next_step(model))
    return sentences


def _not_estimated(found: UnseenWearing) -> list[str]:
    if len(found.wearings) > 1:
        return ["In a wearing not seen: not estimated."]
    return [
        "In a wearing not seen: unknown, all takes are of one wearing. Take the glove off, put it on again "
        "and record a second one."
    ]


def _next_step(model: CalibrationModel) -> str:
    shift = wearing_effect().name
    has_shift = any(item.name == shift for item in model.effects)
    check = (
        "each time the glove is put on, hold three to five poses and run glovecal quick-check; more wearings "
        "in training make the next one better known"
    )
    if has_shift:
        return f"The next wearing is much worse than those seen: {check}."
    return f"The next wearing is much worse than those seen: add {shift} (glovecal add-effect); {check}."


def model_effect(added: AddedEffect) -> ModelEffect:
    """Raises BadInput where the effect is not installed."""
    effect = added.effect
    return ModelEffect(
        effect=added.name,
        explanation=effect.about.explanation,
        rotations=added.active,
        parameters=added.described(),
        curves=added.curves,
        context=effect.context,
        has_memory=has_memory(effect),
        settling_s=added.transient_s,
        evidence=added.evidence,
        declaration=added.settings.get("declaration"),
    )
