"""Hands through a sequence of frames whose fingertips do what they are known to do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.inverse_kinematics.clamped_step import clamped_pull, clamped_step
from glovecal_models.inverse_kinematics.contact import Contact
from glovecal_models.inverse_kinematics.hand_shape import HandShape
from glovecal_models.inverse_kinematics.tip_chains import TipChains

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
SWAYED, LEAST_EAGER = 0.8, 0.2
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
        """Steps until the joints are still. Where they sway, the eagerness to get back to the shape falls."""
        low, high = self.chains.limits_deg.T
        at, before, steps = np.clip(start_deg, low, high), np.zeros(len(low)), 0
        eagerness = most_eager = 1.0
        while True:
            step, distance, force = self._step(at, eagerness)
            furthest = float(np.abs(step).max())
            still = STILL_DEG * eagerness if distance < TIP_TOLERANCE_MM else STUCK_DEG
            if furthest < still or steps == MOST_STEPS:
                return _Solution(at, distance, force / eagerness, steps)
            at = np.clip(at + step * min(1.0, LONGEST_STEP_DEG / max(furthest, STILL_DEG)), low, high)
            if step @ before < 0:
                eagerness, most_eager = eagerness / 2, max(SWAYED * eagerness, LEAST_EAGER)
            else:
                eagerness = min(most_eager, 1.5 * eagerness)
            before, steps = step, steps + 1

    def _step(self, at: np.ndarray, eagerness: float) -> tuple[np.ndarray, float, np.ndarray]:
        """The step (K,) in degrees, the distance in mm, the force."""
        tips, slopes = self.chains.tips_and_slopes(at[None])
        missing, rows = self.contact.missing(tips[0], self.frame)
        distance = float(np.sqrt((missing * missing).sum()))
        by_angle = rows.reshape(missing.size, -1) @ slopes[0].reshape(-1, len(at)) * self.sd_deg
        room = (self.chains.limits_deg.T - at) / self.sd_deg
        back = eagerness * (self.centre_deg - at) / self.sd_deg
        step, force = clamped_step(by_angle, clamped_pull(missing).ravel(), distance, back, room)
        return step * self.sd_deg, distance, force
