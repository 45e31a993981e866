"""Joint angles over time as Gaussian processes, estimated with what came before and after.

The prior is a motion whose jerk is white noise (its estimate is a spline of fifth degree), the measurement
its angle with white noise. One number decides: the time over which frames are averaged. It is that of the
largest likelihood, of each joint and about each minute anew, so that a still hand is averaged longer than a
fast one. In the form of a state space this costs time in proportion to the frames: a Kalman filter forward,
and backward what later frames say of earlier ones (de Jong 1989, Journal of the American Statistical
Association 84(408) 1085).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from glovecal_models.effects.base.dynamics import unbroken

STATES = 3
"""Angle, velocity, acceleration."""
TIMES_S = np.geomspace(0.004, 1.0, 17)
"""Tried: an angle's motion below 1 / (2 pi) of a second's frequency is kept (half of its power there)."""
PIECE_FRAMES = 4096
"""Smoothed at once, with a smoothness of their own; bounds the memory."""
MARGIN_S = 8.0
"""Before and after each piece: a frame further away says nothing, with the longest of the times."""
SHORTEST_RUN = 8
"""Frames; fewer stay as they are."""
UNKNOWN = 1e6
"""Variance of the first state, in those of a frame's noise and in units of the time."""
LEAST_NOISE_DEG2 = 1e-10


@dataclass(frozen=True)
class SmoothedMotion:
    """N frames of L joints."""

    state: np.ndarray
    """(N, L, 3): degrees, degrees / s, degrees / s^2."""
    covariance: np.ndarray
    """(N, L, 3, 3) of it."""
    noise: np.ndarray
    """(N, L), degrees squared: variance of the noise of single frames, that was found."""
    is_measured: np.ndarray
    """(N, L): there or later; else, and in runs too short to smooth, the state is the angle as it came."""

    def put(self, rows: slice | np.ndarray, part: SmoothedMotion, inner: slice = slice(None)) -> None:
        """Frames ``inner`` of ``part`` into ``rows``."""
        for name in ("state", "covariance", "noise", "is_measured"):
            getattr(self, name)[rows] = getattr(part, name)[inner]

    def variance(self, weights: np.ndarray) -> np.ndarray:
        """(N, L) of the sum of the state times ``weights`` (L, 3)."""
        # After many seconds without a measurement rounding may leave less than nothing.
        return np.maximum(np.einsum("nlij,li,lj->nl", self.covariance, weights, weights), 0.0)


def smoothed(time_s: np.ndarray, angles: np.ndarray, known: np.ndarray | None = None) -> SmoothedMotion:
    """Of ``angles`` (N, L), degrees, at rising ``time_s`` (N,); where not ``known`` (N, L) they do not count.

    Nothing is averaged over gaps in which the state of effects is forgotten, too.
    """
    known = np.ones(angles.shape, bool) if known is None else known
    motion = unsmoothed(angles)
    for run in unbroken(time_s):
        for kept, around in _pieces(time_s, run):
            if around.stop - around.start < SHORTEST_RUN:
                continue
            part = _smoothed(time_s[around], angles[around], known[around])
            inner = slice(kept.start - around.start, kept.stop - around.start)
            motion.put(kept, part, inner)
    return motion


def unsmoothed(angles: np.ndarray) -> SmoothedMotion:
    """``angles`` (N, L) as they came, to be filled in."""
    frames, joints = angles.shape
    state = np.zeros((frames, joints, STATES))
    state[:, :, 0] = angles
    covariance, noise = np.zeros((frames, joints, STATES, STATES)), np.zeros(angles.shape)
    return SmoothedMotion(state, covariance, noise, np.zeros(angles.shape, bool))


def _pieces(time_s: np.ndarray, run: slice) -> list[tuple[slice, slice]]:
    """Rows of each piece of ``run``, and the same with a margin on either side."""
    count = max(1, round((run.stop - run.start) / PIECE_FRAMES))
    edges = np.linspace(run.start, run.stop, count + 1).astype(int).tolist()
    pieces = []
    for start, stop in itertools.pairwise(edges):
        if stop > start:
            ends = time_s[start] - MARGIN_S, time_s[stop - 1] + MARGIN_S
            first, last = np.searchsorted(time_s, ends).tolist()
            pieces.append((slice(start, stop), slice(max(first, run.start), min(last, run.stop))))
    return pieces


def _smoothed(time_s: np.ndarray, angles: np.ndarray, known: np.ndarray) -> SmoothedMotion:
    elapsed = np.diff(time_s, prepend=time_s[:1])
    every_s = max(float(np.median(elapsed[1:])), 1e-6)
    filled = _filled(angles, known)
    tau, noise = _most_likely(filled, every_s)
    state, covariance = _both_ways(elapsed, every_s, filled, known, tau)
    is_measured = np.logical_or.accumulate(known[::-1])[::-1]
    return in_degrees(state, covariance, tau, np.broadcast_to(noise, angles.shape), is_measured)


def in_degrees(
    state: np.ndarray,
    covariance: np.ndarray,
    tau: np.ndarray,
    noise: np.ndarray,
    is_measured: np.ndarray,
) -> SmoothedMotion:
    """From units of the times ``tau``, seconds, and of the noise, both (N, L) or as broadcast to it."""
    unit = tau[..., None] ** -np.arange(STATES)
    size = noise[..., None, None] * unit[..., :, None] * unit[..., None, :]
    return SmoothedMotion(state * unit, covariance * size, noise, is_measured)


def _filled(angles: np.ndarray, known: np.ndarray) -> np.ndarray:
    """The last known angle where none is known; the first one before it."""
    rows = np.where(known, np.arange(len(angles))[:, None], -1)
    last = np.maximum.accumulate(rows, axis=0)
    first = np.where(known.any(axis=0), known.argmax(axis=0), 0)
    return np.take_along_axis(angles, np.where(last < 0, first, last), axis=0)


def transition(h: np.ndarray) -> np.ndarray:
    """(..., 3, 3) over ``h`` (...), in units of the time."""
    one, none = np.ones_like(h), np.zeros_like(h)
    rows = ((one, h, h * h / 2), (none, one, h), (none, none, one))
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def disturbance(h: np.ndarray) -> np.ndarray:
    """(..., 3, 3): covariance that white jerk of density 1 adds over ``h`` (...)."""
    rows = (
        (h**5 / 20, h**4 / 8, h**3 / 6),
        (h**4 / 8, h**3 / 3, h**2 / 2),
        (h**3 / 6, h**2 / 2, h),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _most_likely(angles: np.ndarray, every_s: float) -> tuple[np.ndarray, np.ndarray]:
    """(L,) times, seconds, and variances of a frame's noise, degrees squared, by the likelihood of frames
    taken as evenly spaced: then all joints share the gains of each time."""
    h = every_s / TIMES_S
    forward, added = transition(h), disturbance(h) * h[:, None, None]
    covariance = UNKNOWN * np.tile(np.eye(STATES), (len(h), 1, 1))
    joints = angles.shape[1]
    state = np.zeros((len(h), joints, STATES))
    state[:, :, 0] = angles[0]
    square, log_spread, counted = np.zeros((len(h), joints)), np.zeros(len(h)), 0
    for number, angle in enumerate(angles):
        if number:
            state = state @ forward.transpose(0, 2, 1)
            covariance = forward @ covariance @ forward.transpose(0, 2, 1) + added
        spread = covariance[:, 0, 0] + 1.0
        gain = covariance[:, :, 0] / spread[:, None]
        error = angle - state[:, :, 0]
        state = state + error[:, :, None] * gain[:, None, :]
        covariance = covariance - gain[:, :, None] * covariance[:, None, 0, :]
        if number >= STATES:
            square += error * error / spread[:, None]
            log_spread += np.log(spread)
            counted += 1
    noise = np.maximum(square / counted, LEAST_NOISE_DEG2)
    best = np.argmin(counted * np.log(noise) + log_spread[:, None], axis=0)
    return TIMES_S[best], noise[best, np.arange(joints)]


class Forward(NamedTuple):
    """One frame of a Kalman filter, of T times and J joints; in units of each time and of the noise."""

    state: np.ndarray
    """(T, J, 3), predicted from earlier frames."""
    covariance: np.ndarray
    """(T, C, 3, 3) of it; C is J, or 1 where it is that of all joints, as while all are known."""
    gain: np.ndarray
    """(T, C, 3)."""
    innovation: np.ndarray
    """(T, J), degrees: measured minus predicted."""
    weight: np.ndarray
    """(T, C): 1 / variance of the innovation; 0 where the angle is not known."""


class MotionFilter:
    """Predicts each frame from those before it."""

    def __init__(self, angle: np.ndarray) -> None:
        """``angle`` (T, J), degrees, of the first frame."""
        self._state = np.zeros((*angle.shape, STATES))
        self._state[:, :, 0] = angle
        self._covariance = UNKNOWN * np.tile(np.eye(STATES), (len(angle), 1, 1, 1))

    def step(self, forward: np.ndarray, added: np.ndarray, angle: np.ndarray, counts: np.ndarray) -> Forward:
        """The next frame: ``transition`` and added covariance (T, 3, 3) over the time since the last one,
        measured ``angle`` (T, J) and whether it ``counts`` (T, C), 1 or 0, both as broadcast to it."""
        back = forward.swapaxes(-1, -2)
        state = self._state @ back
        covariance = forward[:, None] @ self._covariance @ back[:, None] + added[:, None]
        weight = counts / (covariance[..., 0, 0] + 1.0)
        gain = covariance[..., 0] * weight[..., None]
        innovation = angle - state[..., 0]
        self._state = state + gain * innovation[..., None]
        self._covariance = covariance - gain[..., :, None] * covariance[..., None, 0, :]
        return Forward(state, covariance, gain, innovation, weight)


def _both_ways(
    elapsed: np.ndarray, every_s: float, angles: np.ndarray, known: np.ndarray, tau: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """States (N, L, 3) and their covariances (N, L, 3, 3) in units of ``tau`` (L,) and of the noise."""
    frames, joints = angles.shape
    h = elapsed[:, None] / tau
    forward, added = transition(h), disturbance(h) * (every_s / tau)[:, None, None]
    states, covariances = np.empty((frames, joints, STATES)), np.empty((frames, joints, STATES, STATES))
    gains, errors = np.empty((frames, joints, STATES)), np.empty((frames, joints))
    weights, counts = np.empty((frames, joints)), known.astype(float)
    # Each joint has a time of its own, so T is L, and J is 1.
    motion = MotionFilter(angles[0][:, None])
    for frame in range(frames):
        one = motion.step(forward[frame], added[frame], angles[frame][:, None], counts[frame][:, None])
        states[frame], covariances[frame], gains[frame] = (
            one.state[:, 0],
            one.covariance[:, 0],
            one.gain[:, 0],
        )
        weights[frame], errors[frame] = one.weight[:, 0], (one.innovation * one.weight)[:, 0]
    adjoints, informations = np.empty_like(states), np.empty_like(covariances)
    later = Later.nothing(joints)
    for frame in range(frames - 1, -1, -1):
        if frame < frames - 1:
            later = later.before(forward[frame + 1])
        later = later.measured(gains[frame], errors[frame], weights[frame])
        adjoints[frame], informations[frame] = later
    return smoothed_state(states, covariances, adjoints, informations)


class Later(NamedTuple):
    """What a frame and later ones say of the state that was predicted there."""

    adjoint: np.ndarray
    """(..., 3)."""
    information: np.ndarray
    """(..., 3, 3): how much they know of it."""

    @classmethod
    def nothing(cls, *shape: int) -> Later:
        return cls(np.zeros((*shape, STATES)), np.zeros((*shape, STATES, STATES)))

    def before(self, forward: np.ndarray) -> Later:
        """Of the state before the ``transition`` (..., 3, 3)."""
        back = forward.swapaxes(-1, -2)
        return Later((back @ self.adjoint[..., None])[..., 0], back @ self.information @ forward)

    def measured(self, gain: np.ndarray, error: np.ndarray, weight: np.ndarray) -> Later:
        """With the frame's own measurement: gains (..., 3), weighted innovation and weight (...)."""
        adjoint, information = self.adjoint.copy(), self.information.copy()
        adjoint[..., 0] += error - (gain * adjoint).sum(axis=-1)
        information[..., :, 0] -= (information @ gain[..., :, None])[..., 0]
        information[..., 0, :] -= (gain[..., None, :] @ information)[..., 0, :]
        information[..., 0, 0] += weight
        return Later(adjoint, information)


def smoothed_state(
    state: np.ndarray, covariance: np.ndarray, adjoint: np.ndarray, information: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(..., 3) and (..., 3, 3): what was predicted, with what ``Later`` says of it."""
    return (
        state + (covariance @ adjoint[..., None])[..., 0],
        covariance - covariance @ information @ covariance,
    )
