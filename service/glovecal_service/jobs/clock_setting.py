"""What a clock offset is set to when it is added by hand: the clock scan's answer, else the diagnosis's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.effects.catalogue import effect
from glovecal_models.improvement.add_effect import repaired_takes, wanted_of
from glovecal_models.improvement.clocks import clock_settings, coarse_clock_settings
from glovecal_models.improvement.known_effects import known_effects
from glovecal_models.takes.take import Take

CLOCK = "clock_offset"
LAG = "lag"
"""Judging a lag, the only other delay, judges the clocks too."""


def clock_setting(
    model: CalibrationModel, takes: Sequence[Take], cancelled: Callable[[], bool]
) -> dict[str, Any] | None:
    """Settings of the effect ``clock_offset``; None when the clocks agree. Raises BadInput, Cancelled."""
    coarse = coarse_clock_settings(takes)
    if coarse is not None:
        return coarse
    wanted = [item for item in wanted_of(model) if item.name != CLOCK]
    found = diagnose(
        repaired_takes(takes, wanted),
        model.layout,
        linear=model.method in ("raw", "linear"),
        known=[item for item in known_effects(model) if item.effect.name not in (CLOCK, LAG)],
        effects=[effect(LAG)],
        signatures=False,
        cancelled=cancelled,
    )
    for item in found.assessments:
        if item.effect == CLOCK and item.shapes[0].any():
            return clock_settings([take.name for take in takes], item.shapes[0])
    return None
