"""What an effect without columns is set to when it is added by hand: it is looked for in the takes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.signatures import own_sensors
from glovecal_models.effects.catalogue import effect
from glovecal_models.effects.saturation import saturated_bands
from glovecal_models.effects.signature_effect import SignatureEffect
from glovecal_models.errors import BadInput
from glovecal_models.improvement.add_effect import repaired_takes, trained_rotations, wanted_of
from glovecal_models.improvement.clocks import clock_settings, coarse_clock_settings
from glovecal_models.improvement.known_effects import known_effects
from glovecal_models.takes.take import Take
from glovecal_service.jobs.added_by_signature import ADDED_BY_SIGNATURE, CLOCK, SATURATION

LAG = "lag"
"""Judging a lag, the only other delay, judges the clocks too."""


def effect_constants(
    model: CalibrationModel, takes: Sequence[Take], name: str, cancelled: Callable[[], bool]
) -> dict[str, Any] | None:
    """None for an effect with columns. Raises BadInput when nothing is found, Cancelled."""
    if name not in ADDED_BY_SIGNATURE:
        return None
    wanted = [item for item in wanted_of(model) if item.name != name]
    repaired = repaired_takes(takes, wanted)
    if name == CLOCK:
        found = _clock(model, repaired, cancelled)
    elif name == SATURATION:
        bands = saturated_bands(repaired, own_sensors(model.layout, trained_rotations(model)))
        found = {"bands": [band.to_settings() for band in bands]} if bands else None
    else:
        found = _repair(model, repaired, name)
    if found is None:
        raise BadInput(f"effect {name!r}: nothing of it is found in these {len(takes)} takes")
    return found


def saturated_rotations(constants: dict[str, Any] | None) -> tuple[str, ...] | None:
    """The rotations that saturation is on; None for other effects."""
    bands = (constants or {}).get("bands")
    return None if bands is None else tuple(dict.fromkeys(band["rotation"] for band in bands))


def _repair(model: CalibrationModel, takes: Sequence[Take], name: str) -> dict[str, Any] | None:
    repair = effect(name)
    sensor_of = own_sensors(model.layout, trained_rotations(model))
    found = repair.find(takes, sensor_of) if isinstance(repair, SignatureEffect) and sensor_of else ()
    return {"where": sorted({place for item in found for place in item.where})} if found else None


def _clock(
    model: CalibrationModel, takes: Sequence[Take], cancelled: Callable[[], bool]
) -> dict[str, Any] | None:
    """The clock scan's answer for large offsets, else the diagnosis's; None when the clocks agree."""
    coarse = coarse_clock_settings(takes)
    if coarse is not None:
        return coarse
    diagnosis = diagnose(
        takes,
        model.layout,
        linear=model.method in ("raw", "linear"),
        known=[item for item in known_effects(model) if item.effect.name not in (CLOCK, LAG)],
        effects=[effect(LAG)],
        signatures=False,
        cancelled=cancelled,
    )
    for item in diagnosis.assessments:
        if item.effect == CLOCK and item.shapes[0].any():
            return clock_settings([take.name for take in takes], item.shapes[0])
    return None
