"""What a linear calibration is trained on: a rotation's own sensor, at the key poses.

The commonly used baseline of Wang & Neff 2013, section 7.1: every sensor by itself, a line through the key
poses of section 5.1.1. Where a layout has no sensor of a rotation's name (an ankle sleeve), all sensors of
its correspondence are used; where no key poses were recorded, or a rotation hardly moves in them (the
wrist), all samples are: a line through noise would be no fair baseline.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.calibration.samples import Samples
from glovecal_models.layout import Correspondence

KEY_POSES = ("flat", "spread", "fist", "overbend")
LEAST_SHARE_OF_RANGE = 0.25
"""Key poses must span this share of a rotation's recorded range to carry its line."""


def linear_correspondence(correspondence: Correspondence) -> Correspondence:
    """The rotation read from its measuring sensor alone, when it has one."""
    if correspondence.simulated or correspondence.rotation not in correspondence.sensors:
        return correspondence
    return Correspondence(correspondence.rotation, "1S1R", (correspondence.rotation,))


def linear_samples(samples: Samples) -> Samples:
    """The samples at key poses, when these move the rotation enough; else all."""
    at_key_pose = np.isin(samples.poses.astype(str), KEY_POSES)
    if not at_key_pose.any():
        return samples
    chosen = samples.select(np.flatnonzero(at_key_pose))
    spans = np.ptp(chosen.target) >= LEAST_SHARE_OF_RANGE * np.ptp(samples.target)
    return chosen if spans and np.ptp(chosen.inputs, axis=0).min() > 0 else samples
