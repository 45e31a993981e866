"""How large this wearing's shift is, told by the poses themselves.

The default prior is of gloves that shift by degrees. One that hardly does would be corrected by what the
person's poses are off, so the prior's scale is fitted first: the likeliest one for all rotations and poses at
once (empirical Bayes; Rasmussen & Williams 2006, equation 5.8).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from glovecal_models.quick_check.wearing_shift import PoseError, WearingShift

SCALES = np.geomspace(0.05, 3.0, 42)
"""Of the default prior's standard deviations."""
SCALE_SD = 2.0
"""Of the logarithm of the scale, before any pose: gloves differ a lot."""


def scaled_to_poses(prior: WearingShift, poses: Sequence[PoseError]) -> WearingShift:
    """``prior`` with the scale that makes ``poses`` likeliest; as it is where they tell nothing."""
    known = [np.flatnonzero(pose.known) for pose in poses]
    rows = [prior.rows(lanes, pose.joint[lanes]) for lanes, pose in zip(known, poses, strict=True)]
    error = np.concatenate([pose.error[lanes] for lanes, pose in zip(known, poses, strict=True)] or [[]])
    if not len(error):
        return prior
    noise = np.concatenate([pose.variance[lanes] for lanes, pose in zip(known, poses, strict=True)])
    onto = np.concatenate(rows)
    spread = onto @ prior.covariance @ onto.T
    scale = max(SCALES.tolist(), key=lambda each: _evidence(each, error, spread, noise))
    return WearingShift(prior.mean, scale**2 * prior.covariance)


def _evidence(scale: float, error: np.ndarray, spread: np.ndarray, noise: np.ndarray) -> float:
    """Log probability of the errors and of the scale, but for constants."""
    factor = cho_factor(scale**2 * spread + np.diag(noise), lower=True)
    log_determinant = 2 * float(np.log(np.diag(factor[0])).sum())
    fit = float(error @ cho_solve(factor, error))
    return -0.5 * (log_determinant + fit + (np.log(scale) / SCALE_SD) ** 2)
