"""Template calibration: a scale and an offset for each equation (Krnoul et al. 2016, section 3.3).

Every rotation follows its own sensor, Y = a X + b (equation 1). The palm flex sensor enters three more:

    palm                          R_ppx = a TRC_px + b                                      (2)
    flexion of the little finger  R_pmx = a TRC_pmx + b + 0.75 R_ppx                        (3)
    abduction of the thumb        R_tma = a TRC_tma + b + a_tpx TRC_px + b_tpx              (5)

The two offsets of equation (5) are added and cannot be told apart: here they are one. Where no take says how
far the palm was bent, equation (2) cannot be found, and (3) is used without its last term. Rotations without
a sensor follow the layout's rule: the last joints of fingers are interpolated for 18 sensors, read for 22.

``two_shapes`` is the glove maker's way: equation (1) alone, through two hand shapes, the flat hand and thumb
and index finger together.

A linear calibration as the prior mean of LMC-GPR: a process of what the planes leave.

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
from glovecal_models.calibration.samples import Samples, gather_samples, linear_correspondence
from glovecal_models.calibration.training_settings import PriorPlane
from glovecal_models.covariance.functions import LinearArd, SquaredExponentialArd
from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import PALM
from glovecal_models.layout import Correspondence
from glovecal_models.progress import Cancel, Report
from glovecal_models.regression.exact import fit_exact
from glovecal_models.regression.linear_regressor import LinearRegressor, ZeroMean, fit_linear, gains_of
from glovecal_models.regression.regressor import ProcessRegressor
from glovecal_models.regression.training_samples import check_samples
from glovecal_models.takes.take import Take

PALM_SHARE = 0.75
"""Of the palm's angle that the little finger's flexion gets (equation 3); the paper's, found by trial."""
PINKY, THUMB = "P_MCP", "TI_ABD"
"""The rotations of equations (3) and (5)."""
FLAT, PINCH = ("flat",), ("touch-I", "ok")
"""Names of the glove maker's two shapes."""
MOST_PRIOR_SAMPLES = 400
"""Of a rotation, evenly from those that were chosen: every one is a node of an exact process."""


def template_correspondence(item: Correspondence, sensors: Sequence[str]) -> Correspondence:
    """What the equation of a rotation reads; ``sensors``: those of the glove that work."""
    own = linear_correspondence(item)
    if own.rotation in (PINKY, THUMB) and own.sensors == (own.rotation,) and PALM in sensors:
        return Correspondence(own.rotation, "MS1R", (own.rotation, PALM))
    return own


def palm_samples(takes: Sequence[Take], item: Correspondence) -> Samples | None:
    """Samples of equation (2) where ``item`` is read by equation (3), else None."""
    if item.sensors != (PINKY, PALM):
        return None
    return gather_samples(takes, Correspondence(PALM, "1S1R", (PALM,)))


def palm_gain(palm: Samples | None) -> float:
    """Degrees of the little finger's flexion a count of the palm's sensor: 0.75 times the scale of equation
    (2), from samples of the palm; 0 where there are none."""
    if palm is None or len(palm) == 0 or np.ptp(palm.target) == 0:
        return 0.0
    gains, _ = gains_of(fit_linear(palm.inputs, palm.target, sensor_names=(PALM,)))
    return PALM_SHARE * float(gains[0])


def two_shapes(samples: Samples) -> Samples:
    """Those of the glove maker's two shapes; none where one of the two was not taken."""
    poses = samples.poses.astype(str)
    shown = [np.isin(poses, shape) for shape in (FLAT, PINCH)]
    both = shown[0] | shown[1] if all(one.any() for one in shown) else np.zeros(len(samples), dtype=bool)
    return samples.select(np.flatnonzero(both))


def missing_shapes(rotations: Sequence[str], takes: Sequence[Take]) -> str:
    """Why ``rotations`` have no line of two shapes."""
    named = sorted({name for take in takes for name in take.poses or () if name})
    return (
        f"{', '.join(rotations)}: measured in no frame of one of the two shapes, {FLAT[0]} and "
        f"{' or '.join(PINCH)}; poses of these takes are: {', '.join(named) or 'none'}"
    )


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
