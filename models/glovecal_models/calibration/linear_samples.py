"""What a linear calibration is trained on: a rotation's own sensor, at the key poses.

The commonly used baseline of Wang & Neff 2013, section 7.1: every sensor by itself, a line through the key
poses of section 5.1.1. Where a layout has no sensor of a rotation's name (an ankle sleeve), all sensors of
its correspondence are used, and where no key poses were recorded, all samples.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.calibration.samples import Samples
from glovecal_models.layout import Correspondence

KEY_POSES = ("flat", "spread", "fist", "overbend")


def linear_correspondence(correspondence: Correspondence) -> Correspondence:
    """The rotation read from its measuring sensor alone, when it has one."""
    if correspondence.simulated or correspondence.rotation not in correspondence.sensors:
        return correspondence
    return Correspondence(correspondence.rotation, "1S1R", (correspondence.rotation,))


def linear_samples(samples: Samples) -> Samples:
    """The samples at key poses, when at least two different ones were recorded; else all."""
    at_key_pose = np.isin(samples.poses.astype(str), KEY_POSES)
    if len(np.unique(samples.poses[at_key_pose].astype(str))) < 2:
        return samples
    chosen = samples.select(np.flatnonzero(at_key_pose))
    moves = np.ptp(chosen.inputs, axis=0).min() > 0 and np.ptp(chosen.target) > 0
    return chosen if moves else samples
