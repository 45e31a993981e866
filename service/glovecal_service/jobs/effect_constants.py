"""What an effect without columns is set to when it is added by hand: it is looked for in the takes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from glovecal_models.calibration.had_already import repaired_takes, trained_rotations, wanted_of
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.signatures import own_sensors, static_errors
from glovecal_models.effects.base.signature_effect import SignatureEffect
from glovecal_models.effects.catalogue import effect
from glovecal_models.effects.garment_slip.garment_slip import GarmentSlip
from glovecal_models.effects.saturation.saturation import saturated_bands
from glovecal_models.errors import BadInput
from glovecal_models.improvement.clocks import clock_settings, coarse_clock_settings
from glovecal_models.improvement.known_effects import known_effects
from glovecal_models.takes.take import Take
from glovecal_service.jobs.added_by_signature import ADDED_BY_SIGNATURE, CLOCK, SATURATION, SLIP

LAG = "lag"
"""Judging a lag, the only other delay, judges the clocks too."""


def effect_constants(
    model: CalibrationModel, takes: Sequence[Take], name: str, cancelled: Callable[[], bool]
) -> dict[str, Any] | None:
    """None for an effect with columns. Raises BadInput when nothing is found, Cancelled."""
    if name not in ADDED_BY_SIGNATURE:
        return None
    if name == SLIP:
        return {}
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


def widened_rotations(
    model: CalibrationModel,
    takes: Sequence[Take],
    name: str,
    constants: dict[str, Any] | None,
    asked: tuple[str, ...] | None,
) -> tuple[str, ...] | None:
    """The rotations that saturation or a slip is on; those ``asked`` for with other effects.

    Raises BadInput when no slip is found and nobody said where to look for it.
    """
    if name == SATURATION:
        return tuple(dict.fromkeys(band["rotation"] for band in (constants or {})["bands"]))
    if name != SLIP or asked is not None:
        return asked
    repaired = repaired_takes(takes, wanted_of(model))
    sensor_of = own_sensors(model.layout, trained_rotations(model))
    found = GarmentSlip().find(repaired, sensor_of, static_errors(repaired, sensor_of))
    if not found:
        raise BadInput(f"effect {name!r}: nothing of it is found in these {len(takes)} takes")
    return tuple(dict.fromkeys(name for item in found for name in item.where))


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
