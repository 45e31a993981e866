"""The steps of a falling error: simpler calibrations, the versions of a model, controls and noise floor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.comparison.noise_floor import reaches_floor
from glovecal_models.comparison.residuals import Residuals, residuals
from glovecal_models.takes.take import Take


@dataclass(frozen=True)
class Fall:
    """A calibration and its error over all rotations."""

    label: str
    rmse_deg: float
    control_rmse_deg: float | None = None
    """The error with the newest effect's control in its place."""
    is_scale: bool = False
    """A simpler calibration, there for scale."""


@dataclass(frozen=True)
class FloorBand:
    """The noise floor over all rotations, 95 % interval."""

    floor_deg: float
    low_deg: float
    high_deg: float

    @classmethod
    def of(cls, floors: Mapping[str, Sequence[float]]) -> FloorBand | None:
        """``floors``: for each rotation floor, low and high; None without any."""
        if not floors:
            return None
        return cls(
            *(float(np.sqrt(np.mean(np.square(column)))) for column in zip(*floors.values(), strict=True))
        )


def fall_sentence(falls: Sequence[Fall], band: FloorBand | None) -> str:
    """From where to where, against control and floor."""
    base = next((item for item in falls if not item.is_scale), falls[0])
    last = falls[-1]
    scale = [f"{item.rmse_deg:.2f} for {item.label}" for item in falls if item.is_scale]
    beside = f" ({', '.join(scale)})" if scale else ""
    if last is base:
        sentence = (
            f"The error of {_inline(base.label)} alone is {base.rmse_deg:.2f} degrees{beside}; no effect was "
            "added"
        )
    else:
        added = ", ".join(_inline(item.label) for item in falls[falls.index(base) + 1 :])
        verb = "falls" if last.rmse_deg < base.rmse_deg else "changes"
        sentence = (
            f"The error {verb} from {base.rmse_deg:.2f} degrees with {_inline(base.label)}{beside} to "
            f"{last.rmse_deg:.2f} with {added.replace('+ ', '')}"
        )
        if last.control_rmse_deg is not None:
            sentence += f" (control of the last effect: {last.control_rmse_deg:.2f})"
    if band is None:
        return f"{sentence}. The noise floor of these takes is unknown."
    reached = reaches_floor(last.rmse_deg, band.high_deg)
    rest = (
        "the error is at the floor"
        if reached
        else f"the error is {last.rmse_deg - band.floor_deg:.2f} degrees above it"
    )
    return f"{sentence}. The noise floor is {band.floor_deg:.2f}: {rest}."


def _inline(label: str) -> str:
    return label.replace("\n", " ")


def lineage_falls(
    line: Sequence[CalibrationModel], scale: Mapping[str, CalibrationModel], takes: Sequence[Take]
) -> list[Fall]:
    """``line``: the versions, oldest first; ``scale``: simpler calibrations by name.

    Raises LayoutMismatch, BadInput as residuals do.
    """
    falls = [Fall(name, _rmse_deg(residuals(model, takes)), is_scale=True) for name, model in scale.items()]
    falls.sort(key=lambda item: -item.rmse_deg)
    before: CalibrationModel | None = None
    found: Residuals | None = None
    for model in line:
        earlier, found = found, residuals(model, takes)
        control = None
        if before is not None and earlier is not None:
            control = with_control(model, before, earlier.stacked("error") ** 2, earlier.rotations)
        falls.append(Fall(version_label(model, before), _rmse_deg(found), control))
        before = model
    return falls


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
