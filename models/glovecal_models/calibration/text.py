"""Sentences about training: which samples, sensors and weights a model was trained with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from glovecal_models.calibration.training_plan import TrainingPlan
from glovecal_models.calibration.usable_sensors import UsableSensors


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
    return [*sentences, *dead_sensor_sentences(plan.usable, plan.unreadable)]


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
