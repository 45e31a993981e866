"""One step of clamped damped least squares (Wang & Neff 2013, equations 2 and 3) that keeps joint limits.

Everything here is counted in standard deviations of the hand's shape, in which every joint is equally stiff.
Then, with z the way back to the shape, equation (2) is the least change of (angles - shape) that carries the
tips by e: its fixed point is the likeliest hand (equation 4) whose tips are where they should be.

As printed, z points up the gradient and would drive the hand away from its shape; here it points down. The
paper slows joints beyond their range by a factor w; here a joint never leaves its range: it is held at the
limit (w = 0) as long as it would go beyond, and the others take over its share.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import lsq_linear

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
