"""How the error fell from version to version of a model, all held against the same takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.comparison.compare import RotationErrors
from glovecal_models.comparison.residuals import Residuals, residuals
from glovecal_models.takes.take import Take
from glovecal_service.report.error_fall import Fall, FloorBand, error_fall


def lineage_fall(
    line: Sequence[CalibrationModel],
    scale: Mapping[str, CalibrationModel],
    takes: Sequence[Take],
    over_all: RotationErrors,
) -> tuple[str, str]:
    """``line``: the versions, oldest first; ``scale``: simpler calibrations by name.

    ``over_all`` are the newest one's errors. Raises LayoutMismatch, BadInput as residuals do.
    """
    falls = [Fall(name, _rmse_deg(residuals(model, takes)), is_scale=True) for name, model in scale.items()]
    falls.sort(key=lambda item: -item.rmse_deg)
    before: CalibrationModel | None = None
    found: Residuals | None = None
    for model in line:
        earlier, found = found, residuals(model, takes)
        decoy = None if before is None or earlier is None else _with_decoy(model, before, earlier)
        falls.append(Fall(_label(model, before), _rmse_deg(found), decoy))
        before = model
    floor = over_all.floor
    band = None if floor is None else FloorBand(floor.floor_deg, floor.low_deg, floor.high_deg)
    return error_fall(falls, band)


def _rmse_deg(found: Residuals) -> float:
    return float(np.sqrt(np.nanmean(found.stacked("error") ** 2)))


def _with_decoy(model: CalibrationModel, before: CalibrationModel, earlier: Residuals) -> float | None:
    """The error over all rotations with the newest effect's decoy instead, from the share it left when the
    effect was added; None where that is not known. ``earlier`` are the residuals without the effect.
    """
    had = {item.name for item in before.effects}
    gained = [item for item in model.effects if item.name not in had and "rmse_decoy_deg" in item.evidence]
    if not gained:
        return None
    square = earlier.stacked("error") ** 2
    for item in gained:
        share = item.evidence["rmse_decoy_deg"] / max(item.evidence["rmse_before_deg"], 1e-12)
        for name in set(item.active) & set(earlier.rotations):
            square[:, earlier.column(name)] *= min(share, 1.0) ** 2
    return float(np.sqrt(np.nanmean(square)))


def _label(model: CalibrationModel, before: CalibrationModel | None) -> str:
    """What is new in a version."""
    if before is None or model.method != before.method:
        return model.method
    now, earlier = ([item.name for item in one.effects] for one in (model, before))
    gained = [name for name in dict.fromkeys(now) if name not in earlier]
    lost = [name for name in dict.fromkeys(earlier) if name not in now]
    if not gained and not lost:
        return f"{model.method}\nagain"
    return "\n".join([*(f"+ {name}" for name in gained), *(f"- {name}" for name in lost)])
