"""Errors of the models of an improvement, beside simpler calibrations and the noise floor; why it stopped."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from glovecal_models.calibration.held_out_check import HeldOutErrors, held_out_errors
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import Method, TrainingSettings
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.comparison.limits import COMPARISON_LIMITS, ComparisonLimits
from glovecal_models.comparison.noise_floor import is_at_floor as is_one_at_floor
from glovecal_models.comparison.residuals import residuals
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.improvement.improvement import Step, Stop
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

SIMPLER: tuple[Method, ...] = ("raw", "linear")


def step_errors(
    model: CalibrationModel, holdout: Sequence[Take], held_out: HeldOutErrors
) -> tuple[dict[str, float], float]:
    """RMSE, degrees, of each rotation and overall: on ``holdout`` when there is one, else ``held_out``."""
    if not holdout:
        return {name: held_out.rmse_deg(name) for name in held_out.square}, held_out.overall_deg
    found = residuals(model, holdout)
    error = found.stacked("error")
    each = {
        name: float(np.sqrt(np.nanmean(error[:, found.column(name)] ** 2)))
        for name in found.measured_rotations
    }
    return each, float(np.sqrt(np.nanmean(error**2)))


def is_at_floor(
    rmse_deg: Mapping[str, float],
    floors: Mapping[str, NoiseFloor],
    limits: ComparisonLimits = COMPARISON_LIMITS,
) -> bool:
    """Whether every rotation whose floor is known is at it; False when none is."""
    pairs = [(rmse_deg[name], floor) for name, floor in floors.items() if name in rmse_deg]
    return bool(pairs) and all(is_one_at_floor(error, floor, limits) for error, floor in pairs)


def baselines(
    takes: Sequence[Take],
    layout: Layout,
    rotations: Sequence[str],
    settings: TrainingSettings,
    holdout: Sequence[Take],
) -> dict[str, float]:
    """RMSE in degrees by method, on ``holdout`` or, without one, on held-out takes."""
    found: dict[str, float] = {}
    for method in SIMPLER:
        if method == settings.method:
            continue
        if holdout:
            model = train(takes, layout, "baseline", TrainingSettings(method=method, folds=0))
            error = residuals(model, holdout).stacked("error")
            found[method] = float(np.sqrt(np.nanmean(error**2)))
        else:
            plain = TrainingSettings(method=method, folds=settings.folds)
            prepared = PreparedTakes.of(takes, layout)
            found[method] = held_out_errors(prepared, rotations, [], plain).overall_deg
    return found


def why_stopped(
    stopped: Stop,
    steps: Sequence[Step],
    floors: Mapping[str, NoiseFloor],
    diagnosis: Diagnosis | None,
    limits: ComparisonLimits = COMPARISON_LIMITS,
) -> Stop:
    """``stopped`` so far ("nothing_named" or "not_better"), or what is known better of the end."""
    held = diagnosis.hold_drift if diagnosis else None
    if held is not None:
        return "ambiguous" if len(held.confidence_set) > 1 else "nothing_named"
    # Errors against a wrong reference, and their floor, mean nothing.
    doubtful = diagnosis is not None and bool(diagnosis.reference_problems)
    if not doubtful and is_at_floor(steps[-1].per_rotation, floors, limits):
        return "noise_floor"
    added = [step.added for step in steps if step.added is not None]
    undecided = diagnosis is not None and len(diagnosis.naming.confidence_set) > 1
    if (added and added[-1].verdict == "ambiguous") or (stopped == "nothing_named" and undecided):
        return "ambiguous"
    return stopped
