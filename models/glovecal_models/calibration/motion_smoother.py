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

    def variance(self, weights: np.ndarray) -> np.ndarray:
        """(N, L) of the sum of the state times ``weights`` (L, 3)."""
        return np.einsum("nlij,li,lj->nl", self.covariance, weights, weights)


def smoothed(time_s: np.ndarray, angles: np.ndarray, known: np.ndarray | None = None) -> SmoothedMotion:
    """Of ``angles`` (N, L), degrees, at rising ``time_s`` (N,); where not ``known`` (N, L) they do not count.

    Nothing is averaged over gaps in which the state of effects is forgotten, too.
    """
    frames, joints = angles.shape
    known = np.ones(angles.shape, bool) if known is None else known
    state = np.zeros((frames, joints, STATES))
    state[:, :, 0] = angles
    motion = SmoothedMotion(state, np.zeros((frames, joints, STATES, STATES)), np.zeros(angles.shape))
    for run in unbroken(time_s):
        for kept, around in _pieces(time_s, run):
            if around.stop - around.start < SHORTEST_RUN:
                continue
            part = _smoothed(time_s[around], angles[around], known[around])
            inner = slice(kept.start - around.start, kept.stop - around.start)
            motion.state[kept], motion.covariance[kept] = part.state[inner], part.covariance[inner]
            motion.noise[kept] = part.noise[inner]
    return motion


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
    unit = tau[:, None] ** -np.arange(STATES)
    return SmoothedMotion(
        state * unit,
        covariance * (noise[:, None, None] * unit[:, :, None] * unit[:, None, :]),
        np.broadcast_to(noise, angles.shape),
    )


def _filled(angles: np.ndarray, known: np.ndarray) -> np.ndarray:
    """The last known angle where none is known; the first one before it."""
    rows = np.where(known, np.arange(len(angles))[:, None], -1)
    last = np.maximum.accumulate(rows, axis=0)
    first = np.where(known.any(axis=0), known.argmax(axis=0), 0)
    return np.take_along_axis(angles, np.where(last < 0, first, last), axis=0)


def _transition(h: np.ndarray) -> np.ndarray:
    """(..., 3, 3) over ``h`` (...), in units of the time."""
    one, none = np.ones_like(h), np.zeros_like(h)
    rows = ((one, h, h * h / 2), (none, one, h), (none, none, one))
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _disturbance(h: np.ndarray) -> np.ndarray:
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
    forward, added = _transition(h), _disturbance(h) * h[:, None, None]
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


def _both_ways(
    elapsed: np.ndarray, every_s: float, angles: np.ndarray, known: np.ndarray, tau: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """States (N, L, 3) and their covariances (N, L, 3, 3) in units of ``tau`` (L,) and of the noise."""
    frames, joints = angles.shape
    h = elapsed[:, None] / tau
    forward, added = _transition(h), _disturbance(h) * (every_s / tau)[:, None, None]
    states, covariances = np.empty((frames, joints, STATES)), np.empty((frames, joints, STATES, STATES))
    gains, errors = np.empty((frames, joints, STATES)), np.empty((frames, joints))
    state = np.zeros((joints, STATES))
    state[:, 0] = angles[0]
    covariance = UNKNOWN * np.tile(np.eye(STATES), (joints, 1, 1))
    counts = known.astype(float)
    for frame in range(frames):
        if frame:
            state = (forward[frame] @ state[:, :, None])[:, :, 0]
            covariance = forward[frame] @ covariance @ forward[frame].swapaxes(-1, -2) + added[frame]
        states[frame], covariances[frame] = state, covariance
        weight = counts[frame] / (covariance[:, 0, 0] + 1.0)
        gains[frame] = gain = covariance[:, :, 0] * weight[:, None]
        error = angles[frame] - state[:, 0]
        errors[frame] = error * weight
        state = state + gain * error[:, None]
        covariance = covariance - gain[:, :, None] * covariance[:, None, 0, :]
    adjoints, informations = _backward(forward, gains, errors, counts / (covariances[:, :, 0, 0] + 1.0))
    return (
        states + (covariances @ adjoints[..., None])[..., 0],
        covariances - covariances @ informations @ covariances,
    )


def _backward(
    forward: np.ndarray, gains: np.ndarray, errors: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """What each frame and all later ones say of the state that was predicted there, (N, L, 3), and how much
    they know of it, (N, L, 3, 3)."""
    frames, joints = errors.shape
    adjoints, informations = np.empty((frames, joints, STATES)), np.empty((frames, joints, STATES, STATES))
    later, knowledge = np.zeros((joints, STATES)), np.zeros((joints, STATES, STATES))
    for frame in range(frames - 1, -1, -1):
        if frame < frames - 1:
            back = forward[frame + 1].swapaxes(-1, -2)
            later = (back @ later[:, :, None])[:, :, 0]
            knowledge = back @ knowledge @ forward[frame + 1]
        gain = gains[frame]
        later[:, 0] += errors[frame] - (gain * later).sum(axis=1)
        knowledge[:, :, 0] -= (knowledge @ gain[:, :, None])[:, :, 0]
        knowledge[:, 0, :] -= (gain[:, None, :] @ knowledge)[:, 0, :]
        knowledge[:, 0, 0] += weights[frame]
        adjoints[frame], informations[frame] = later, knowledge
    return adjoints, informations
