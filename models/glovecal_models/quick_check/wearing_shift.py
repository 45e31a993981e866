"""What is known of one wearing's shift: a Gaussian over each rotation's offset and gain, updated by poses.

A linear Gaussian model (Rasmussen & Williams 2006, equations A.6 and 2.7 to 2.8): a pose in which the hand
was held is one witness of each rotation, error = offset + gain x joint + noise, however many frames it has.
Rotations that read the same sensor shift together, so a rotation that nobody measured learns from those that
share its sensors.

The default prior is of gloves that shift by degrees. One that hardly does would be corrected by what the
person's poses are off, so the prior's scale is fitted first: the likeliest one for all rotations and poses at
once (empirical Bayes; Rasmussen & Williams 2006, equation 5.8).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from glovecal_models.calibration.samples import SensorSensitivity

SHIFT_OF_RANGE = 0.04
"""Default prior, where a model has learned none from its wearings: each sensor shifts by this share of its
trained range, as a standard deviation. 3.5 degrees of a 90 degree joint (Gracia-Ibanez et al. 2016)."""
GAIN_OF_OFFSET = 0.5
"""Default prior of the gain (degrees per standard deviation of the joint), as a share of the offset's."""
OWN_SHARE = 0.1
"""Of an offset's variance that is the rotation's own: its regressor is no straight line in the readings."""


@dataclass(frozen=True)
class PoseError:
    """One held pose as a witness: for L rotations, NaN where nothing is known of the angle."""

    error: np.ndarray
    """(L,), degrees: known angle minus the prediction without a shift."""
    joint: np.ndarray
    """(L,): the joint in its own standard deviations, what the gain multiplies."""
    variance: np.ndarray
    """(L,), degrees squared: what model and hand are off by in one pose."""

    @property
    def known(self) -> np.ndarray:
        """(L,) True where the pose says something."""
        return np.isfinite(self.error) & np.isfinite(self.joint) & np.isfinite(self.variance)


@dataclass(frozen=True)
class WearingShift:
    """Offsets (first L) and gains (last L) of one wearing: mean (2 L,), covariance (2 L, 2 L), degrees."""

    mean: np.ndarray
    covariance: np.ndarray

    @property
    def lanes(self) -> int:
        return len(self.mean) // 2

    def updated(self, pose: PoseError) -> WearingShift:
        """After one more witness. The order of poses does not matter, nor whether they come one by one."""
        known = np.flatnonzero(pose.known)
        if not len(known):
            return self
        rows = self.rows(known, pose.joint[known])
        spread = rows @ self.covariance @ rows.T + np.diag(pose.variance[known])
        gain = np.linalg.solve(spread, rows @ self.covariance).T
        mean = self.mean + gain @ (pose.error[known] - rows @ self.mean)
        kept = np.eye(len(mean)) - gain @ rows
        # Joseph's form: stays symmetric and positive whatever the rounding.
        covariance = kept @ self.covariance @ kept.T + (gain * pose.variance[known]) @ gain.T
        return WearingShift(mean, covariance)

    def after(self, poses: Iterable[PoseError]) -> WearingShift:
        shift = self
        for pose in poses:
            shift = shift.updated(pose)
        return shift

    def rows(self, lanes: np.ndarray, joint: np.ndarray) -> np.ndarray:
        """(K, 2 L): what K lanes at K joint values (in standard deviations) make of the state."""
        rows = np.zeros((len(lanes), len(self.mean)))
        place = np.arange(len(lanes))
        rows[place, lanes], rows[place, self.lanes + lanes] = 1.0, joint
        return rows

    def contradiction(self, pose: PoseError) -> float:
        """Mean squared surprise of a pose's rotations: near 1 when it fits what is known."""
        known = np.flatnonzero(pose.known)
        rows = self.rows(known, pose.joint[known])
        spread = rows @ self.covariance @ rows.T + np.diag(pose.variance[known])
        off = pose.error[known] - rows @ self.mean
        return float(off @ np.linalg.solve(spread, off)) / max(len(known), 1)

    @property
    def lane_covariance(self) -> np.ndarray:
        """(L, 2, 2): offset and gain of each rotation by itself."""
        at = np.arange(self.lanes)
        pair = np.stack([at, self.lanes + at], axis=1)
        return self.covariance[pair[:, :, None], pair[:, None, :]]

    @property
    def usual_variance(self) -> np.ndarray:
        """(L,), degrees squared: of a rotation's correction over its usual postures (joint 0 ± 1)."""
        return np.trace(self.lane_covariance, axis1=1, axis2=2)


def prior_shift(sensitivity: SensorSensitivity, learned_sd: np.ndarray | None = None) -> WearingShift:
    """Before any pose: no shift, with the standard deviations (L, 2) that the model learned for offset and
    gain, degrees, else the default prior."""
    shared = _shared_covariance(sensitivity)
    default = np.sqrt(np.diag(shared))
    sd = np.column_stack([default, GAIN_OF_OFFSET * default]) if learned_sd is None else learned_sd
    alike = (1 - OWN_SHARE) * shared / np.outer(default, default) + OWN_SHARE * np.eye(len(default))
    lanes = len(default)
    covariance = np.zeros((2 * lanes, 2 * lanes))
    covariance[:lanes, :lanes] = alike * np.outer(sd[:, 0], sd[:, 0])
    covariance[lanes:, lanes:] = np.diag(sd[:, 1] ** 2)
    return WearingShift(np.zeros(2 * lanes), covariance)


def sensor_shift(
    sensitivity: SensorSensitivity, prior: WearingShift, shift: WearingShift
) -> tuple[np.ndarray, np.ndarray]:
    """By how much each sensor reads more than in training, (S,) in readings, and its standard deviation.

    The sensors' shifts and the rotations' offsets are jointly Gaussian; what is known of the offsets is
    handed on to the sensors.
    """
    lanes = prior.lanes
    shared = _shared_covariance(sensitivity)
    default = np.sqrt(np.diag(shared))
    sd = np.sqrt(np.diag(prior.covariance)[:lanes])
    sensor_sd = SHIFT_OF_RANGE * sensitivity.range * float(np.median(sd / default))
    towards = -(sensitivity.slope * sensor_sd**2).T / np.linalg.norm(sensitivity.slope * sensor_sd, axis=1)
    common = np.sqrt(1 - OWN_SHARE) * towards * sd
    back = np.linalg.solve(prior.covariance[:lanes, :lanes], common.T).T
    known = prior.covariance[:lanes, :lanes] - shift.covariance[:lanes, :lanes]
    variance = sensor_sd**2 - np.einsum("sl,lm,sm->s", back, known, back)
    return back @ shift.mean[:lanes], np.sqrt(np.maximum(variance, 0.0))


def _shared_covariance(sensitivity: SensorSensitivity) -> np.ndarray:
    """(L, L), degrees squared: offsets of the rotations when every sensor shifts by the default prior."""
    moved = sensitivity.slope * SHIFT_OF_RANGE * sensitivity.range
    shared = moved @ moved.T
    # A rotation that moves with no sensor still needs a prior that is not zero.
    still = np.diag(shared) <= 0
    return shared + np.diag(np.where(still, 1e-6, 0.0))


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
