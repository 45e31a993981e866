"""Refinement by hand: a person turns the scale and offset of single rotations until the hand looks right.

Krnoul et al. 2016 (section 3.3.4) let an animator refine a template beside the take's video. A rotation whose
equation is a line gets ``scale * angle + offset``; the model is not changed but followed by a child, so that
every change is a version and can be taken back.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from glovecal_models.calibration.model import CalibrationModel, RotationModel
from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_models.regression.linear_regressor import LinearRegressor

LEAST_SCALE, MOST_SCALE = 0.1, 10.0
LARGEST_OFFSET_DEG = 180.0
HOW = "refined by hand: not measured"


@dataclass(frozen=True)
class Refinement:
    """Of one rotation."""

    scale: float = 1.0
    offset_deg: float = 0.0

    def __post_init__(self) -> None:
        if not LEAST_SCALE <= self.scale <= MOST_SCALE:
            raise BadInput(f"scale is {self.scale}; it must be {LEAST_SCALE:g} to {MOST_SCALE:g}")
        if not abs(self.offset_deg) <= LARGEST_OFFSET_DEG:
            raise BadInput(
                f"offset_deg is {self.offset_deg}; it must be within {LARGEST_OFFSET_DEG:g} degrees of 0"
            )

    @property
    def inverse(self) -> Refinement:
        """What takes it back. Raises BadInput where that is out of range."""
        return Refinement(1.0 / self.scale, -self.offset_deg / self.scale)


def refined(
    model: CalibrationModel, changes: Mapping[str, Refinement], parent_id: str | None = None
) -> CalibrationModel:
    """A child of ``model`` with the angles of some rotations scaled and shifted.

    Its held-out error is unknown where it was changed: a person's eye is no measurement. Raises BadInput for
    a rotation that the model does not have, that is no line, or that effects correct.
    """
    if not changes:
        raise BadInput("no rotation is to be refined")
    known = {item.rotation: item for item in model.rotations}
    for name in changes:
        _require_line(known.get(name), name, model)
    rotations = tuple(
        _refined(item, changes[item.rotation]) if item.rotation in changes else item
        for item in model.rotations
    )
    return replace(
        model, rotations=rotations, parent=parent_id, error_estimate={"how": HOW}, unseen_wearing=None
    )


def refinable(model: CalibrationModel) -> tuple[str, ...]:
    """Its rotations that are lines no effect corrects."""
    corrected = {name for item in model.effects for name in item.rotations}
    return tuple(
        item.rotation
        for item in model.rotations
        if isinstance(item.regressor, LinearRegressor) and item.rotation not in corrected
    )


def _require_line(item: RotationModel | None, name: str, model: CalibrationModel) -> None:
    if item is None:
        meant = did_you_mean(name, model.rotation_names, there="it has")
        raise BadInput(f"no rotation {name!r} in this model; {meant}")
    if name in refinable(model):
        return
    lines = ", ".join(refinable(model)) or "none"
    if isinstance(item.regressor, LinearRegressor):
        raise BadInput(f"{name} is corrected by an effect: refine the model before effects; lines: {lines}")
    raise BadInput(
        f"{name} is {item.regressor.method}, no line: only a scale and an offset are refined by hand;"
        f" lines: {lines}"
    )


def _refined(item: RotationModel, change: Refinement) -> RotationModel:
    line = item.regressor
    assert isinstance(line, LinearRegressor)
    fresh = replace(
        line,
        slope=change.scale * line.slope,
        intercept=change.scale * line.intercept + change.offset_deg,
        variance_root=change.scale * line.variance_root,
        noise_variance=change.scale**2 * line.noise_variance,
        evidence=dict(line.evidence) | {"refined_by_hand": True},
    )
    return replace(
        item,
        regressor=fresh,
        uncertain_above_deg=change.scale * item.uncertain_above_deg,
        held_out_rmse_deg=None,
    )
