"""How small a fingertip's error can get: the noise floors of its joints, carried to the tip.

Each joint's floor moves the tip by its column of the Jacobian; the joints' noises are taken as independent,
so their squares add up. Neighbours that share a sensor's noise are not quite that.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.comparison.hand_poses import HandPoses
from glovecal_models.hand.forward_kinematics import forward_kinematics, tip_jacobian
from glovecal_models.hand.rotations import HAND_ROTATIONS
from glovecal_models.hand.skeleton import Skeleton

MOST_FRAMES = 3000
"""Frames that the floor is averaged over, spread over all."""
_ENDS = ("floor_deg", "low_deg", "high_deg")


@dataclass(frozen=True)
class FingertipFloor:
    """With the interval that the ends of the joints' 95 % intervals give."""

    floor_mm: float
    low_mm: float
    high_mm: float
    is_lower_bound: bool
    """That of some joint is one: noise with a memory is not in it."""


class CarriedFloors:
    """The joints' floors, carried to the tips of some of the measured hands."""

    def __init__(self, skeleton: Skeleton, poses: HandPoses, floors: Mapping[str, NoiseFloor | None]) -> None:
        poses = poses.every(MOST_FRAMES)
        self._frames = forward_kinematics(skeleton, poses.measured)
        slopes = tip_jacobian(skeleton, self._frames)
        self._slopes = slopes * poses.compared[:, None, None, :]
        self._counts = poses.counts
        self._floors = [floors.get(name) for name in HAND_ROTATIONS]

    def of_tips(self, tips: list[int]) -> FingertipFloor | None:
        """Of some fingertips together; None when some joint's floor is unknown."""
        squares = (self._slopes[:, tips] ** 2).sum(axis=2)[self._counts[:, tips]]
        return self._floor(squares, lambda sizes: float(np.mean(squares @ sizes**2)))

    def of_distance(self, first: int, second: int) -> FingertipFloor | None:
        """Of the distance between two fingertips. Touching tips can only move apart, so noise is drawn."""
        both = self._counts[:, first] & self._counts[:, second]
        slopes = (self._slopes[:, first] - self._slopes[:, second])[both]
        gaps = (self._frames.tips_mm[:, first] - self._frames.tips_mm[:, second])[both]
        drawn = np.random.default_rng(0).standard_normal((len(gaps), len(HAND_ROTATIONS)))

        def mean_square(sizes: np.ndarray) -> float:
            moved = gaps + np.einsum("nar,nr->na", slopes, drawn * sizes)
            change = np.linalg.norm(moved, axis=1) - np.linalg.norm(gaps, axis=1)
            return float(np.mean(change**2))

        return self._floor((slopes**2).sum(axis=1), mean_square)

    def _floor(
        self, squares: np.ndarray, mean_square: Callable[[np.ndarray], float]
    ) -> FingertipFloor | None:
        """``squares`` (K, R): which rotations move it at all; ``mean_square`` of the joints' floors (R,)."""
        if not len(squares):
            return None
        moving = squares.max(axis=0) > 0
        known = [floor for floor, moves in zip(self._floors, moving, strict=True) if moves]
        if not known or None in known:
            return None
        floor, low, high = (np.sqrt(mean_square(self._sizes(end, moving))) for end in _ENDS)
        return FingertipFloor(
            float(floor),
            float(low),
            float(high),
            any(one is not None and one.is_lower_bound for one in known),
        )

    def _sizes(self, end: str, moving: np.ndarray) -> np.ndarray:
        pairs = zip(self._floors, moving, strict=True)
        return np.array(
            [getattr(floor, end) if moves and floor is not None else 0.0 for floor, moves in pairs]
        )
