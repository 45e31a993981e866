"""How the error fell from version to version of a model, all held against the same takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from glovecal_models.calibration.comparison import RotationErrors
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.comparison.residuals import residuals
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
    falls = [Fall(name, _rmse_deg(model, takes), is_scale=True) for name, model in scale.items()]
    falls.sort(key=lambda item: -item.rmse_deg)
    before: CalibrationModel | None = None
    for model in line:
        falls.append(Fall(_label(model, before), _rmse_deg(model, takes)))
        before = model
    floor = over_all.floor
    band = None if floor is None else FloorBand(floor.floor_deg, floor.low_deg, floor.high_deg)
    return error_fall(falls, band)


def _rmse_deg(model: CalibrationModel, takes: Sequence[Take]) -> float:
    return float(np.sqrt(np.nanmean(residuals(model, takes).stacked("error") ** 2)))


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
