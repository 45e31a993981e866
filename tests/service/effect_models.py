"""Models with effects made by hand."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from realtime_support import LAYOUT, linear_model

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.effects.base.effect import CorrectionEffect
from glovecal_models.effects.catalogue import stored_effect
from glovecal_models.effects.sensor_fault.fault_watch import FaultLimits

UNITS: dict[str, Any] = {"own_centre_deg": [20.0], "own_scale_deg": [30.0]}
"""Settings of effects that read the joint in its own units; one lane stands for all."""


def added(
    name: str,
    shape: Iterable[float],
    weights: Iterable[float],
    rotations: tuple[str, ...] = LAYOUT.rotations,
    settings: dict[str, Any] | None = None,
) -> AddedEffect:
    """The same shape and weights on each of ``rotations``; weights that are not given are zero."""
    lanes, settings = len(rotations), settings or {}
    learned = np.array(list(weights), dtype=float)
    known = stored_effect(name, settings)
    names = known.weights(settings).names if isinstance(known, CorrectionEffect) else ()
    missing = len(names) - len(learned)
    learned = np.pad(learned, (0, missing))
    grid = np.tile(np.array(list(shape), dtype=float), (lanes, 1))
    return AddedEffect(name, rotations, settings, grid, np.tile(learned, (lanes, 1)), np.zeros(lanes))


FOLLOWED = {
    "start": {"noise": 0.1, "slope": 0.0, "slope_sd": 0.01, "curvature_sd": 1e-4},
    "steepest_per_s": 0.05,
}
"""Settings of an effect whose sensors follow a context column late."""
HYSTERESIS = added("hysteresis", (5.0,), (0.4, 0.3, 0.2))
CREEP_WEIGHTS = (0.05, 0.05, 0.15, 0.03, 0.02, 0.1)
CREEP = added("creep", (0.5, 1.1, 2.5), CREEP_WEIGHTS, ("I_MCP", "M_MCP"), settings=UNITS)
LAG = added("lag", (0.05,), (0.2, 0.3, 0.1), ("I_PIP",))


def model_with(*effects: AddedEffect) -> CalibrationModel:
    base = linear_model("anna", degrees_per_count=0.5)
    return replace(base, effects=effects, sensor_centre=np.full(3, 120.0), sensor_scale=np.full(3, 50.0))


MODEL = model_with(HYSTERESIS, CREEP, LAG)
"""Every kind of memory at once."""

FAULT_LIMITS = FaultLimits(
    sensors=LAYOUT.sensors,
    lag_s=(0.01, 0.1, 0.5),
    surprise_counts=((12.0, 20.0, 60.0),) * 3,
    still_s=(0.2,) * 3,
    rotations=LAYOUT.rotations,
    move_lag_s=(0.01, 0.1, 1.0),
    move_deg=((0.5, 5.0, 30.0),) * len(LAYOUT.rotations),
    reads=tuple((LAYOUT.correspondence(name).sensors[0],) for name in LAYOUT.rotations),
)
FAULT = added("sensor_fault", (), (), settings={"where": ["I_MCP"], "live": FAULT_LIMITS.to_settings()})
"""A sensor that fails is watched for live."""
