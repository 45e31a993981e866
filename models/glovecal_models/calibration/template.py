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
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.calibration.samples import Samples, gather_samples, linear_correspondence
from glovecal_models.hand.rotations import PALM
from glovecal_models.layout import Correspondence
from glovecal_models.regression.known_line import gains_of
from glovecal_models.regression.linear_regressor import fit_linear
from glovecal_models.takes.take import Take

PALM_SHARE = 0.75
"""Of the palm's angle that the little finger's flexion gets (equation 3); the paper's, found by trial."""
PINKY, THUMB = "P_MCP", "TI_ABD"
"""The rotations of equations (3) and (5)."""
FLAT, PINCH = ("flat",), ("touch-I", "ok")
"""Names of the glove maker's two shapes."""


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
