"""Where a few fingertips are against the palm: forward kinematics and Jacobian of their chains alone.

``hand/forward_kinematics.py`` computes every joint of the hand. A touch needs two chains, several times a
frame: here they are worked out side by side, the shorter one with idle joints in front.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import FINGERS, WRIST
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.hand_ranges import ACTIVE_RANGE_DEG


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
