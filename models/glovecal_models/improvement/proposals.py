"""Effects without columns as they would be added: looked for in the takes, by their signature."""

from __future__ import annotations

from collections.abc import Sequence, Set
from typing import NamedTuple

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.model_recipe import repaired_takes, requested_effects, trained_rotations
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.diagnosis.known_effect import known_effects
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.diagnosis.model_on_takes import ModelOnTakes
from glovecal_models.diagnosis.posed_holds import are_pose_labels
from glovecal_models.diagnosis.signatures import are_held_levels, own_sensors, static_errors
from glovecal_models.effects.base.signature_effect import FoundBefore, Proposal, Recorded, SignatureEffect
from glovecal_models.effects.catalogue import catalogue
from glovecal_models.errors import BadInput
from glovecal_models.progress import Cancel
from glovecal_models.takes.take import Take


class Proposed(NamedTuple):
    """One effect to be added."""

    effect: str
    proposal: Proposal


def repairs(
    model: CalibrationModel, takes: Sequence[Take], without: Set[str], found_before: FoundBefore | None = None
) -> list[Proposed]:
    """What the measurement needs; ``without`` is not looked for."""
    return _looked_for(model, takes, "repair", without, found_before)


def widenings(
    model: CalibrationModel,
    takes: Sequence[Take],
    diagnosis: Diagnosis | None,
    without: Set[str],
    found_before: FoundBefore | None = None,
) -> list[Proposed]:
    """What is left when nothing more is to be corrected: where and how much the interval has to be wider.

    An effect that is asked for last is proposed where the diagnosis found it.
    """
    rotations, last = trained_rotations(model), []
    signature = [] if diagnosis is None or are_pose_labels(takes) else diagnosis.signature
    for name in dict.fromkeys(item.effect for item in signature):
        effect = catalogue()[name]
        found = [item for item in signature if item.effect == name]
        where = tuple(dict.fromkeys(place for item in found for place in item.where if place in rotations))
        if effect.kind == "interval" and effect.stage == "last" and where and name not in without:
            last.append(Proposed(name, Proposal({}, where, tuple(item.sentence for item in found))))
    late = {name for name, item in catalogue().items() if item.stage == "last"}
    return [*last, *_looked_for(model, takes, "interval", without | late, found_before)]


def proposed(
    model: CalibrationModel,
    takes: Sequence[Take],
    effect: SignatureEffect,
    rotations: Sequence[str] | None,
    cancelled: Cancel | None = None,
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS,
) -> Proposal:
    """What is found of ``effect`` in ``takes``, as it would be added on ``rotations`` (None: where it is
    found). Raises BadInput when nothing is found, Cancelled."""
    if effect.learns_unfound and rotations is not None:
        return Proposal({}, tuple(rotations))
    others = [item for item in requested_effects(model) if item.name != effect.name]
    repaired = repaired_takes(takes, others)
    found = effect.proposed(recorded(model, repaired))
    if found is None and effect.stage == "compared":
        found = _by_comparison(model, repaired, effect, cancelled, limits)
    if found is None:
        raise BadInput(
            f"effect {effect.name!r}: nothing of it is found in these {len(takes)} takes that adding it mends"
        )
    return found


def recorded(
    model: CalibrationModel, takes: Sequence[Take], found_before: FoundBefore | None = None
) -> Recorded:
    """Takes as effects look at them by their signature."""
    sensor_of = own_sensors(model.layout, trained_rotations(model))
    known = known_effects(model)

    def static() -> list[np.ndarray]:
        return static_errors(takes, sensor_of, known)

    return Recorded(tuple(takes), sensor_of, static, are_held_levels(takes), found_before or FoundBefore())


def _looked_for(
    model: CalibrationModel,
    takes: Sequence[Take],
    kind: str,
    without: Set[str],
    found_before: FoundBefore | None,
) -> list[Proposed]:
    if are_pose_labels(takes):
        return []
    found, looked_at = [], recorded(model, takes, found_before)
    for name, effect in catalogue().items():
        if isinstance(effect, SignatureEffect) and effect.kind == kind and name not in without:
            proposal = effect.proposed(looked_at)
            if proposal is not None:
                found.append(Proposed(name, proposal))
    return found


def _by_comparison(
    model: CalibrationModel,
    takes: Sequence[Take],
    effect: SignatureEffect,
    cancelled: Cancel | None,
    limits: DiagnosisLimits,
) -> Proposal | None:
    found = (
        ModelOnTakes.of_repaired(model, takes)
        .without(effect.name, *effect.alike)
        .diagnosed(
            effects=[effect],
            signatures=False,
            limits=limits,
            cancelled=cancelled,
        )
    )
    assessed = next((item for item in found.assessments if item.effect == effect.name), None)
    constants = effect.constants_of(assessed, [take.name for take in takes]) if assessed else None
    return None if constants is None else Proposal(constants)
