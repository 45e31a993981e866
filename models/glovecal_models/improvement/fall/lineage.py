"""The fall of the error over the versions of a model, beside simpler calibrations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from glovecal_models.calibration.methods import Method
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.comparison.answer import RotationErrors
from glovecal_models.comparison.residuals import Residuals, residuals
from glovecal_models.improvement.fall.answer import FallStep, FloorBand, fall_chart
from glovecal_models.layout import Layout
from glovecal_models.presentation.document import Chart
from glovecal_models.progress import Cancel, Report, part
from glovecal_models.takes.take import Take

SIMPLER: tuple[Method, ...] = ("raw", "linear")


def lineage_fall(
    line: Sequence[CalibrationModel],
    scale: Mapping[str, CalibrationModel],
    takes: Sequence[Take],
    overall: RotationErrors,
) -> Chart:
    """``line``: the versions, oldest first; ``scale``: simpler calibrations by name.

    ``overall`` are the newest one's errors. Raises LayoutMismatch, BadInput as residuals do.
    """
    floor = overall.floor
    band = None if floor is None else FloorBand(floor.floor_deg, floor.low_deg, floor.high_deg)
    return fall_chart(lineage_falls(line, scale, takes), band)


def lineage_falls(
    line: Sequence[CalibrationModel], scale: Mapping[str, CalibrationModel], takes: Sequence[Take]
) -> list[FallStep]:
    """``line``: the versions, oldest first; ``scale``: simpler calibrations by name.

    Raises LayoutMismatch, BadInput as residuals do.
    """
    falls = [
        FallStep(name, _rmse_deg(residuals(model, takes)), is_scale=True) for name, model in scale.items()
    ]
    falls.sort(key=lambda item: -item.rmse_deg)
    before: CalibrationModel | None = None
    found: Residuals | None = None
    for model in line:
        earlier, found = found, residuals(model, takes)
        control = None
        if before is not None and earlier is not None:
            control = with_control(model, before, earlier.stacked("error") ** 2, earlier.rotations)
        falls.append(FallStep(version_label(model, before), _rmse_deg(found), control))
        before = model
    return falls


def simpler_calibrations(
    takes: Sequence[Take],
    layout: Layout,
    subject: str,
    methods: Sequence[Method],
    folds: int,
    cancelled: Cancel | None = None,
    report: Report | None = None,
) -> dict[str, CalibrationModel]:
    """By method, trained anew on ``takes``: what a model's errors are read against. With ``folds`` their
    errors are of takes left out in turn; 0: not estimated. Raises BadInput, NotTrainable, Cancelled."""
    share = 1.0 / max(len(methods), 1)
    return {
        method: train(
            takes, layout, subject, TrainingSettings(method=method, folds=folds), cancelled=cancelled,
            report=part(report, share * at, share * (at + 1), f"{method} calibration"),
        )
        for at, method in enumerate(methods)
    }  # fmt: skip


def _rmse_deg(found: Residuals) -> float:
    return float(np.sqrt(np.nanmean(found.stacked("error") ** 2)))


def with_control(
    model: CalibrationModel, before: CalibrationModel, square: np.ndarray, rotations: Sequence[str]
) -> float | None:
    """The error over all rotations with the newest effect's control instead, from the share it left when the
    effect was added; None where that is not known. ``square`` (N, R): squared errors without the effect.
    """
    had = {item.name for item in before.effects}
    evidence = {item.name: dict(item.evidence) for item in model.effects if item.name not in had}
    gained = [item for item in model.effects if "rmse_control_deg" in evidence.get(item.name, ())]
    if not gained:
        return None
    square = square.copy()
    for item in gained:
        known = evidence[item.name]
        share = known["rmse_control_deg"] / max(known["rmse_before_deg"], 1e-12)
        for name in set(item.active) & set(rotations):
            square[:, rotations.index(name)] *= min(share, 1.0) ** 2
    return float(np.sqrt(np.nanmean(square)))


def version_label(model: CalibrationModel, before: CalibrationModel | None) -> str:
    """What is new in a version; line breaks between several effects."""
    if before is None or model.method != before.method:
        return model.method
    now, earlier = ([item.name for item in one.effects] for one in (model, before))
    gained = [name for name in dict.fromkeys(now) if name not in earlier]
    lost = [name for name in dict.fromkeys(earlier) if name not in now]
    if not gained and not lost:
        return f"{model.method}\nretrained"
    return "\n".join([*(f"+ {name}" for name in gained), *(f"- {name}" for name in lost)])
