"""Hands through a sequence of frames whose fingertips do what they are known to do.

Each step is one of clamped damped least squares (Wang & Neff 2013, equations 2 and 3) that keeps joint
limits. It is counted in standard deviations of the hand's shape, in which every joint is equally stiff. Then,
with z the way back to the shape, equation (2) is the least change of (angles - shape) that carries the tips
by e: its fixed point is the likeliest hand (equation 4) whose tips are where they should be.

As printed, z points up the gradient and would drive the hand away from its shape; here it points down. The
paper slows joints beyond their range by a factor w; here a joint never leaves its range: it is held at the
limit (w = 0) as long as it would go beyond, and the others take over its share.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.inverse_kinematics.contact import Contact
from glovecal_models.inverse_kinematics.hand_shape import HandShape
from glovecal_models.inverse_kinematics.tip_chains import TipChains

LONGEST_PULL_MM = 20.0
"""e_max of equation (3)."""
DAMPING_PER_MM2 = 1e-4
"""The damping factor over the squared distance, as a share of the Jacobian's size: 1 at 100 mm."""
SINGULAR = 1e-9
"""Share of the largest squared slope that stands in for directions in which nothing moves."""
LEAST_SQUARE = 1e-6
MOST_EXCHANGES = 8
"""Of joints held at a limit for others, within one step."""


def clamped_pull(missing_mm: np.ndarray) -> np.ndarray:
    """Vectors (G, C), none longer than ``LONGEST_PULL_MM`` (equation 3)."""
    lengths = np.sqrt((missing_mm * missing_mm).sum(axis=1, keepdims=True))
    return missing_mm * (LONGEST_PULL_MM / np.maximum(lengths, LONGEST_PULL_MM))


def clamped_step(
    slopes: np.ndarray, pull: np.ndarray, distance_mm: float, back: np.ndarray, room: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The step (K,), within ``room`` (2, K), and the force (M,) on the tips that goes with it.

    ``slopes``: J (M, K), mm a standard deviation. ``pull``: e (M,). ``distance_mm``: how far the tips are
    off altogether, for the damping. ``back``: z (K,), from here to the shape. At a fixed point ``back`` is
    -J^T force in every joint that is not at its limit.
    """
    low, high = room
    held, at_limit, force = np.zeros(len(back), dtype=bool), np.zeros_like(back), np.zeros_like(pull)
    for _ in range(MOST_EXCHANGES):
        left = pull - slopes @ at_limit
        force = _force(np.where(held, 0.0, slopes), left, distance_mm, back)
        wanted = back + force @ slopes
        beyond = (wanted < low) | (wanted > high)
        if (beyond == held).all():
            return np.clip(wanted, low, high), force
        held, at_limit = beyond, np.where(beyond, np.clip(wanted, low, high), 0.0)
    return _nearest_step(slopes, pull, back, room), force


def _nearest_step(slopes: np.ndarray, pull: np.ndarray, back: np.ndarray, room: np.ndarray) -> np.ndarray:
    """The step that brings the tips nearest, where the limits do not let them go the whole way."""
    from scipy.optimize import lsq_linear  # slow to load, and needed at the joint limits only

    little = np.sqrt(SINGULAR * (slopes * slopes).sum())
    rows = np.vstack([slopes, little * np.eye(len(back))])
    return lsq_linear(rows, np.concatenate([pull, little * back]), bounds=tuple(room)).x


def _force(free: np.ndarray, left: np.ndarray, distance_mm: float, back: np.ndarray) -> np.ndarray:
    """(J J^T + lambda^2 I)^-1 e - (J J^T)^-1 J z.

    Very large where the free joints cannot move the tips: that lets go of a held joint that can.
    """
    squares, directions = np.linalg.eigh(free @ free.T)
    largest = max(squares[-1], LEAST_SQUARE)
    squares = np.maximum(squares, 0.0) + SINGULAR * largest
    damping = (DAMPING_PER_MM2 * distance_mm**2) ** 2 * largest
    along, shape = left @ directions, (free @ back) @ directions
    return directions @ (along / (squares + damping) - shape / squares)


TIP_TOLERANCE_MM = 0.01
"""Tips this close are where they should be."""
STILL_DEG = 0.01
"""No joint moves further in the last step."""
STUCK_DEG = 1e-4
"""Nor does it here, where a finger is bent so that its tip cannot start on the way."""
LONGEST_STEP_DEG = 10.0
SCATTERED_STARTS = 8
"""Hands anywhere within the limits, tried where the way is barred from the last frame and from the shape."""
MOST_STEPS = 200
OSCILLATION_BACK_OFF, LEAST_POSTURE_GAIN = 0.8, 0.2
"""Once swayed, joints come back to their shape in smaller steps."""
AT_LIMIT_DEG = 1e-6


@dataclass(frozen=True)
class FollowedHands:
    """N frames of K rotations in the order of the chains'."""

    angles_deg: np.ndarray
    """(N, K), every one within its limits."""
    missing_mm: np.ndarray
    """(N,), how far the tips are from what they should do; small where the contact can be reached."""
    force: np.ndarray
    """(N, M), 1/mm: slope of the log probability by each component of the contact."""
    steps: np.ndarray
    """(N,)."""


def follow(
    chains: TipChains, contact: Contact, shape: HandShape, start_deg: np.ndarray | None = None
) -> FollowedHands:
    """The likeliest hands of ``shape`` that keep ``contact``: clamped damped least squares, frame by frame.

    Each frame starts from the solution of the one before, the first from ``start_deg`` (K,), else from its
    shape; where that does not lead there, from elsewhere. Solves equations (2) to (6) of Wang & Neff 2013 at
    once: the shape's standard deviations are the stiffness, and the tips meet where both chains are likeliest
    to. Raises BadInput where chains, contact and shape are of different fingers or rotations.
    """
    if contact.fingers != chains.fingers or shape.rotations != chains.rotations:
        raise BadInput(
            f"a contact of {', '.join(contact.fingers)} and a shape of {', '.join(shape.rotations)} were "
            f"given for chains of {', '.join(chains.fingers)}, which move by {', '.join(chains.rotations)}"
        )
    angles, missing = np.empty_like(shape.centre_deg), np.empty(len(shape))
    steps, forces = np.empty(len(shape), dtype=int), []
    at = shape.centre_deg[0] if start_deg is None else np.asarray(start_deg, dtype=float)
    low, high = chains.limits_deg.T
    scattered = np.random.default_rng(0).uniform(low, high, (SCATTERED_STARTS, len(low)))
    for frame, centre in enumerate(shape.centre_deg):
        problem = _Frame(chains, contact, frame, centre, shape.sd_deg[frame])
        found = problem.solved_from([at, centre, *scattered])
        at = angles[frame] = found.angles_deg
        missing[frame], steps[frame] = found.distance_mm, found.steps
        forces.append(found.force)
    return FollowedHands(angles, missing, np.array(forces), steps)


@dataclass(frozen=True)
class _Solution:
    angles_deg: np.ndarray
    distance_mm: float
    force: np.ndarray
    steps: int


@dataclass(frozen=True)
class _Frame:
    chains: TipChains
    contact: Contact
    frame: int
    centre_deg: np.ndarray
    sd_deg: np.ndarray

    def solved_from(self, starts_deg: Sequence[np.ndarray]) -> _Solution:
        """The first that reaches, else the nearest."""
        best = self.solved(starts_deg[0])
        for start in starts_deg[1:]:
            if best.distance_mm <= TIP_TOLERANCE_MM:
                break
            best = min(best, self.solved(start), key=lambda each: each.distance_mm)
        return best

    def solved(self, start_deg: np.ndarray) -> _Solution:
        """Steps until the joints are still. Where they oscillate, the gain towards the posture falls."""
        low, high = self.chains.limits_deg.T
        at, before, steps = np.clip(start_deg, low, high), np.zeros(len(low)), 0
        posture_gain = most_gain = 1.0
        while True:
            step, distance, force = self._step(at, posture_gain)
            furthest = float(np.abs(step).max())
            still = STILL_DEG * posture_gain if distance < TIP_TOLERANCE_MM else STUCK_DEG
            if furthest < still or steps == MOST_STEPS:
                return _Solution(at, distance, force / posture_gain, steps)
            at = np.clip(at + step * min(1.0, LONGEST_STEP_DEG / max(furthest, STILL_DEG)), low, high)
            if step @ before < 0:
                posture_gain, most_gain = (
                    posture_gain / 2,
                    max(OSCILLATION_BACK_OFF * posture_gain, LEAST_POSTURE_GAIN),
                )
            else:
                posture_gain = min(most_gain, 1.5 * posture_gain)
            before, steps = step, steps + 1

    def _step(self, at: np.ndarray, posture_gain: float) -> tuple[np.ndarray, float, np.ndarray]:
        """The step (K,) in degrees, the distance in mm, the force."""
        tips, slopes = self.chains.tips_and_slopes(at[None])
        missing, rows = self.contact.missing(tips[0], self.frame)
        distance = float(np.sqrt((missing * missing).sum()))
        by_angle = rows.reshape(missing.size, -1) @ slopes[0].reshape(-1, len(at)) * self.sd_deg
        room = (self.chains.limits_deg.T - at) / self.sd_deg
        back = posture_gain * (self.centre_deg - at) / self.sd_deg
        step, force = clamped_step(by_angle, clamped_pull(missing).ravel(), distance, back, room)
        return step * self.sd_deg, distance, force
