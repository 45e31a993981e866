"""What fingertips are known to do: touch, hold a rod, or be at given places.

Where a few fingertips are against the palm: forward kinematics and Jacobian of their chains alone.

``hand/forward_kinematics.py`` computes every joint of the hand. A touch needs two chains, several times a
frame: here they are worked out side by side, the shorter one with idle joints in front.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG, FINGERS, WRIST
from glovecal_models.hand.skeleton import Skeleton

ROD_MM = (5.0, 200.0)
"""Lengths of rods that two fingertips can hold."""
SAME_PLACE_MM = 1e-9
"""Tips this close have no direction from one to the other."""


class Contact(Protocol):
    """A condition on the tips of ``fingers``, told as G vectors of C components that should be zero."""

    @property
    def fingers(self) -> tuple[str, ...]:
        """Letters of ``FINGERS``; the tips given to ``missing`` are in this order."""
        ...

    def missing(self, tips_mm: np.ndarray, frame: int) -> tuple[np.ndarray, np.ndarray]:
        """What is still to go in ``frame``, (G, C) mm, and its rows (G, C, F, 3) on the tips (F, 3).

        Where tips move by ``d`` (F, 3), what is to go falls by ``rows`` times ``d``.
        """
        ...


@dataclass(frozen=True)
class Touch:
    """Two fingertips in one place."""

    fingers: tuple[str, str]

    def missing(self, tips_mm: np.ndarray, frame: int) -> tuple[np.ndarray, np.ndarray]:
        return (tips_mm[1] - tips_mm[0])[None], _APART


@dataclass(frozen=True)
class Rod:
    """Two fingertips at the ends of a rod (Wang & Neff 2013, section 9: accuracy where tips are apart)."""

    fingers: tuple[str, str]
    length_mm: float

    def __post_init__(self) -> None:
        low, high = ROD_MM
        if not low <= self.length_mm <= high:
            raise BadInput(f"a rod of {self.length_mm:g} mm; rods are {low:g} to {high:g} mm long")

    def missing(self, tips_mm: np.ndarray, frame: int) -> tuple[np.ndarray, np.ndarray]:
        apart = tips_mm[0] - tips_mm[1]
        distance = max(float(np.sqrt(apart @ apart)), SAME_PLACE_MM)
        along = (apart / distance)[None, None]
        return np.array([[self.length_mm - distance]]), np.stack([along, -along], axis=2)


@dataclass(frozen=True)
class TipPlaces:
    """Fingertips at places that are known in each frame, seen from the palm."""

    fingers: tuple[str, ...]
    places_mm: np.ndarray
    """(N, F, 3), in the skeleton's frame with the wrist straight."""

    def missing(self, tips_mm: np.ndarray, frame: int) -> tuple[np.ndarray, np.ndarray]:
        count = len(self.fingers)
        rows = np.eye(3 * count).reshape(count, 3, count, 3)
        return self.places_mm[frame] - tips_mm, rows


_APART = np.stack([np.eye(3), -np.eye(3)], axis=1)[None]


class TipChains:
    """Chains of F fingertips, moved by K rotations, in the frame of the palm (the wrist straight)."""

    def __init__(self, skeleton: Skeleton, fingers: Sequence[str]) -> None:
        """``fingers``: letters of ``FINGERS``. Raises BadInput for another one and for one named twice."""
        unknown = [finger for finger in fingers if finger not in FINGERS]
        if unknown or not fingers or len(set(fingers)) != len(fingers):
            named = ", ".join(map(repr, fingers)) or "none"
            raise BadInput(f"fingers are {named}; name each once: {', '.join(FINGERS)}")
        self.fingers = tuple(fingers)
        moving = {name for finger in fingers for name in skeleton.chain(finger)}
        self.rotations = tuple(name for name in skeleton.rotations if name in moving)
        self.columns = [skeleton.rotations.index(name) for name in self.rotations]
        """Of these rotations among the skeleton's."""
        self.limits_deg = np.array([ACTIVE_RANGE_DEG[name] for name in self.rotations])
        """(K, 2)."""
        self._fill(skeleton)

    def _fill(self, skeleton: Skeleton) -> None:
        tips = [list(FINGERS).index(finger) for finger in self.fingers]
        wrist = {index for index, joint in enumerate(skeleton.joints) if joint.name in WRIST}
        carrying = [skeleton.carrying(skeleton.tip_joints[tip]) for tip in tips]
        chains = [[joint for joint in chain if joint not in wrist] for chain in carrying]
        depth, count = max(map(len, chains)), len(chains)
        self._weights = np.zeros((depth, count, len(self.rotations)))
        self._axes = np.zeros((depth, count, 3))
        self._turns = np.zeros((3, depth, count, 4, 4))
        self._turns[0] = np.eye(4)
        self._tips = np.ones((count, 4, 1))
        for finger, (tip, chain) in enumerate(zip(tips, chains, strict=True)):
            for place, joint in enumerate(chain, depth - len(chain)):
                self._weights[place, finger] = np.radians(skeleton.weights[joint, self.columns])
                self._axes[place, finger] = skeleton.axes[joint]
                self._turns[:, place, finger, :3, :3] = skeleton.turns[joint]
                self._turns[0, place, finger, :3, 3] = skeleton.offsets_mm[joint]
            self._tips[finger, :3, 0] = skeleton.tips[tip].offset_mm
        self._turning = self._weights.reshape(-1, len(self.rotations)).T

    def tips_and_slopes(self, angles_deg: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Fingertips (N, F, 3) in mm and their derivatives (N, F, 3, K) in mm per degree, at (N, K)."""
        frames = self._frames(angles_deg)
        tips = (frames[:, -1] @ self._tips)[..., :3, 0]
        axes = (frames[..., :3, :3] @ self._axes[..., None])[..., 0]
        moves = _cross(axes, tips[:, None] - frames[..., :3, 3])
        return tips, np.einsum("ndfc,dfk->nfck", moves, self._weights)

    def tips_mm(self, angles_deg: np.ndarray) -> np.ndarray:
        """Fingertips (N, F, 3) at angles (N, K)."""
        return (self._frames(angles_deg)[:, -1] @ self._tips)[..., :3, 0]

    def _frames(self, angles_deg: np.ndarray) -> np.ndarray:
        """Each joint's frame in the palm's, (N, depth, F, 4, 4)."""
        depth, count = self._axes.shape[:2]
        turns = (angles_deg @ self._turning).reshape(-1, depth, count, 1, 1)
        still, sine_part, cosine_part = self._turns
        frames = still + np.sin(turns) * sine_part + (1 - np.cos(turns)) * cosine_part
        for place in range(1, frames.shape[1]):
            frames[:, place] = frames[:, place - 1] @ frames[:, place]
        return frames


def _cross(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Of vectors (..., 3); several times as fast as numpy's for a few of them."""
    return first[..., [1, 2, 0]] * second[..., [2, 0, 1]] - first[..., [2, 0, 1]] * second[..., [1, 2, 0]]
