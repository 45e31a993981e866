"""Effects that a walk adds by their signature in the takes: what to add next, where, with what constants."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass
from typing import Any

from glovecal_models.calibration.had_already import trained_rotations
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.diagnosis.pose_labels import are_pose_labels
from glovecal_models.diagnosis.signatures import are_held_levels, own_sensors
from glovecal_models.effects.base.signature_effect import SignatureEffect
from glovecal_models.effects.catalogue import catalogue
from glovecal_models.effects.saturation.saturation import saturated_bands
from glovecal_models.takes.take import Take

REPAIRS = ("repeated_samples", "sensor_fault")
"""They look like lag, or like anything: asked before all others, in this order."""
SATURATION, SLIP = "saturation", "garment_slip"


@dataclass(frozen=True)
class SignatureStep:
    """One effect to be added."""

    effect: str
    rotations: Sequence[str] | None
    """None: all."""
    constants: dict[str, Any]
    sentences: tuple[str, ...] = ()


def repairs(model: CalibrationModel, takes: Sequence[Take], without: Set[str]) -> list[SignatureStep]:
    """What the measurement needs; ``without`` was tried or is there, in the latter case in ``takes`` too."""
    sensor_of = own_sensors(model.layout, trained_rotations(model))
    if not sensor_of or are_held_levels(takes) or are_pose_labels(takes):
        return []
    steps = []
    for name in REPAIRS:
        effect = catalogue()[name]
        found = (
            effect.find(takes, sensor_of)
            if isinstance(effect, SignatureEffect) and name not in without
            else ()
        )
        if found:
            where = sorted({place for item in found for place in item.where})
            steps.append(SignatureStep(name, None, {"where": where}, tuple(item.sentence for item in found)))
    return steps


def widenings(
    model: CalibrationModel, takes: Sequence[Take], diagnosis: Diagnosis | None, without: Set[str]
) -> list[SignatureStep]:
    """What is left when nothing more is to be corrected: where and how much the interval has to be wider."""
    if are_pose_labels(takes):
        return []
    rotations = trained_rotations(model)
    steps = []
    slips = [item for item in diagnosis.signature if item.effect == SLIP] if diagnosis else []
    slipping = tuple(dict.fromkeys(name for item in slips for name in item.where if name in rotations))
    if slipping and SLIP not in without:
        steps.append(SignatureStep(SLIP, slipping, {}, tuple(item.sentence for item in slips)))
    sensor_of = own_sensors(model.layout, rotations)
    bands = saturated_bands(takes, sensor_of) if sensor_of and SATURATION not in without else ()
    if bands:
        where = tuple(dict.fromkeys(band.rotation for band in bands))
        steps.append(SignatureStep(SATURATION, where, {"bands": [band.to_settings() for band in bands]}))
    return steps
