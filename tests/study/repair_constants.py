"""What the recording itself says about effects that add no columns: clocks, faulty pieces, flat ends."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from blind_glove import BlindGlove

from glovecal_models.diagnosis.signatures import own_sensors
from glovecal_models.effects.base.effect import SignatureEffect
from glovecal_models.effects.catalogue import effect
from glovecal_models.effects.delay.clock_offset import ClockOffsetEffect
from glovecal_models.effects.saturation.saturated_band import saturated_bands
from glovecal_models.takes.take import Take


def repair_constants(glove: BlindGlove, rotations: Sequence[str]) -> dict[str, Any] | None:
    """The settings ``add_effect`` asks for, found in the takes as ``improve`` finds them; None for none."""
    known = effect(glove.truth)
    sensor_of = own_sensors(glove.layout, rotations)
    if glove.truth == "clock_offset":
        return _clocks(glove.takes)
    if glove.truth == "glove_latency":
        return None  # it is found by comparison
    if glove.truth == "saturation":
        return {"bands": [band.to_settings() for band in saturated_bands(glove.takes, sensor_of)]}
    if isinstance(known, SignatureEffect):
        found = known.find(glove.takes, sensor_of)
        return {"where": sorted({name for item in found for name in item.where})}
    return None


def _clocks(takes: Sequence[Take]) -> dict[str, Any]:
    """What the scan of the clocks says of every take."""
    clocks = ClockOffsetEffect().clocks(takes, drift=False)
    offsets = {take.name: float(clock.offset_s) for take, clock in zip(takes, clocks, strict=True)}
    common = float(np.median(list(offsets.values())))
    return {"offset_s": offsets, "common_s": common, "per_take": True, "within_takes": True}
