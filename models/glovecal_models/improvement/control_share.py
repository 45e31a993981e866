"""The share of the error that an effect's control leaves: what the effect itself has to beat."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.diagnosis.candidates import assessed
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.diagnosis.formed_error import formed_control_share
from glovecal_models.diagnosis.forward_basis import ForwardBasis
from glovecal_models.diagnosis.forward_design import forward
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.diagnosis.model_on_takes import ModelOnTakes
from glovecal_models.diagnosis.problem import measured_joints
from glovecal_models.diagnosis.resampled import SMOOTHING, bridge_s, resampled, smoothed
from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.effect import Effect
from glovecal_models.progress import Cancel, stop_if
from glovecal_models.takes.take import Take


def share_left_by_control(
    model: CalibrationModel,
    takes: Sequence[Take],
    effect: Effect,
    rotations: Sequence[str],
    *,
    known_share: float | None = None,
    has_form: bool = False,
    cancelled: Cancel | None = None,
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS,
) -> float | None:
    """Of the RMSE of ``rotations`` on held-out takes, at most 1; None when the takes cannot judge it.

    ``known_share``: what a diagnosis found for the effect's own columns; ``has_form``: the effect has learned
    a form, so that its control may learn one too, and counts with it where that leaves less.
    Raises Cancelled.
    """

    def progress(text: str, share: float) -> None:
        stop_if(cancelled, "adding an effect")

    joints = [name for name in measured_joints(takes, model.layout) if name in rotations]
    if not joints:
        return None
    bridge = bridge_s(takes)
    even = [smoothed(resampled(take, model.layout.sensors, joints, bridge), SMOOTHING) for take in takes]
    on = ModelOnTakes.of_repaired(model, takes).without(effect.name)
    basis = ForwardBasis.of(
        even, model.layout, joints, linear=on.linear, same_angle_share=limits.same_angle_share
    )
    direction = forward(basis, joints, known=on.known, limits=limits)
    if known_share is None:
        found, _ = assessed(direction, [effect], np.random.default_rng(0), set(), progress)
        judged = next((item for item in found if item.effect == effect.name), None)
        known_share = None if judged is None else control_share(judged, rotations)
    formed = formed_control_share(direction, effect, joints) if has_form else None
    return min((share for share in (known_share, formed) if share is not None), default=None)


def share_in(diagnosis: Diagnosis | None, name: str, rotations: Sequence[str]) -> float | None:
    """The same from a diagnosis; None without one, or when it does not rank the effect."""
    ranked = diagnosis.naming.ranked if diagnosis is not None else ()
    judged = next((item for item in ranked if item.effect == name), None)
    return None if judged is None else control_share(judged, rotations)


def control_share(judged: Assessment, rotations: Sequence[str]) -> float | None:
    """The same from an assessment; None when it has none of ``rotations``."""
    pairs = zip(judged.joints, judged.errors, strict=True)
    errors = [error for name, error in pairs if name in rotations]
    base = sum(float(error.base.sum()) for error in errors)
    control = sum(float(error.control.sum()) for error in errors)
    return min(float(np.sqrt(max(control, 0.0) / base)), 1.0) if base > 0 else None
