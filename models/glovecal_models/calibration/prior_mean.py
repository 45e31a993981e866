"""A linear calibration as the prior mean of LMC-GPR: a process of what the planes leave.

Trained in the usual way a process has a plane of its own, as good as the samples make it; where these are few
or one-sided that plane goes astray. Here the mean is that of a template or any linear model, and the process
is of what is left: the covariance of Wang & Neff 2013 (equation 8), linear and squared exponential, with the
average residual for a mean. The linear part leans on the prior's slope; away from all samples the
prediction goes back to the prior, moved by that average.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training_settings import PriorPlane
from glovecal_models.covariance.linear_ard import LinearArd
from glovecal_models.covariance.squared_exponential import SquaredExponentialArd
from glovecal_models.errors import BadInput
from glovecal_models.layout import Correspondence
from glovecal_models.progress import Cancel, Report
from glovecal_models.regression.exact import fit_exact
from glovecal_models.regression.known_line import gains_of
from glovecal_models.regression.linear_regressor import LinearRegressor
from glovecal_models.regression.mean import ZeroMean
from glovecal_models.regression.process_regressor import ProcessRegressor
from glovecal_models.regression.training_samples import check_samples

MOST_PRIOR_SAMPLES = 400
"""Of a rotation, evenly from those that were chosen: every one is a node of an exact process."""


def planes_of(model: CalibrationModel) -> tuple[PriorPlane, ...]:
    """Of every rotation that a line or plane predicts. Raises BadInput where there is none."""
    planes = []
    for item in model.rotations:
        if isinstance(item.regressor, LinearRegressor) and item.correspondence.simulated is None:
            gains, offset = gains_of(item.regressor)
            sensors = item.correspondence.sensors
            planes.append(PriorPlane(item.rotation, sensors, tuple(gains.tolist()), offset))
    if not planes:
        raise BadInput(
            f"a model of method {model.method} is no prior mean: take a linear one, such as a template"
        )
    return tuple(planes)


def plane_for(rotation: str, planes: Sequence[PriorPlane]) -> PriorPlane | None:
    return next((plane for plane in planes if plane.rotation == rotation), None)


def with_sensors_of(item: Correspondence, plane: PriorPlane | None) -> Correspondence:
    """``item`` reading the plane's sensors too, such as the palm's."""
    more = () if plane is None else tuple(name for name in plane.sensors if name not in item.sensors)
    if not more or item.simulated is not None:
        return item
    return Correspondence(item.rotation, "MS1R", (*item.sensors, *more))


def fit_on_plane(
    inputs: np.ndarray,
    target: np.ndarray,
    sensors: Sequence[str],
    plane: PriorPlane,
    *,
    cancelled: Cancel | None = None,
    report: Report | None = None,
) -> ProcessRegressor:
    """The plane and the process of what it leaves; inputs (N, D) of ``sensors``, target (N,) degrees.

    Raises NotTrainable, Cancelled, BadInput where the plane reads a sensor that is no input.
    """
    missing = [name for name in plane.sensors if name not in sensors]
    if missing:
        raise BadInput(
            f"the prior of {plane.rotation} reads {missing[0]}, which is none of {', '.join(sensors)}"
        )
    inputs, target = check_samples(inputs, target, sensors)
    gains = np.zeros(len(sensors))
    for name, gain in zip(plane.sensors, plane.gains, strict=True):
        gains[list(sensors).index(name)] = gain
    some = slice(None, None, max(1, -(-len(target) // MOST_PRIOR_SAMPLES)))
    left = target[some] - inputs[some] @ gains - plane.offset_deg
    process = fit_exact(
        inputs[some], left, ZeroMean(), LinearArd() + SquaredExponentialArd(), starts=2,
        cancelled=cancelled, report=report,
    )  # fmt: skip
    at_shift = float(gains @ process.input_shift) + plane.offset_deg
    return replace(
        process,
        slope=process.slope + gains * process.input_scale,
        intercept=process.intercept + at_shift,
        evidence=process.evidence | {"prior": list(plane.sensors)},
    )
