"""Errors of fingertip positions in mm, and their noise floor.

Each joint's noise floor moves the tip by its column of the Jacobian; the joints' noises are assumed
independent, so their squares add up. Neighbours that share a sensor's noise are not quite independent.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.comparison.hand_poses import HandPoses, compared_rotations, hand_poses, tips_mm
from glovecal_models.comparison.residuals import Residuals
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.forward_kinematics import forward_kinematics, tip_jacobian
from glovecal_models.hand.rotations import FINGERS, PALM
from glovecal_models.hand.skeleton import Skeleton, hand_skeleton

MOST_FRAMES = 3000
"""Frames that the floor is averaged over, spread over all."""
_ENDS = ("floor_deg", "low_deg", "high_deg")
TIPS = tuple(FINGERS.values())
THUMB, INDEX = 0, 1


@dataclass(frozen=True)
class FingertipFloor:
    """With the interval that the ends of the joints' 95 % intervals give."""

    floor_mm: float
    low_mm: float
    high_mm: float
    is_lower_bound: bool
    """That of some joint is one: noise with a memory is not in it."""
    is_reliable: bool = True
    """That of every joint is."""

    def beside(self, rmse_mm: float) -> FingertipFloor:
        """The floor of an error of ``rmse_mm``, never above it."""
        ends = {name: min(getattr(self, name), rmse_mm) for name in ("floor_mm", "low_mm", "high_mm")}
        return replace(self, **ends, is_reliable=self.is_reliable and self.low_mm <= rmse_mm)


class CarriedFloors:
    """The joints' floors, carried to the tips of some of the measured hands."""

    def __init__(self, skeleton: Skeleton, poses: HandPoses, floors: Mapping[str, NoiseFloor | None]) -> None:
        poses = poses.every(MOST_FRAMES)
        self._frames = forward_kinematics(skeleton, poses.measured)
        slopes = tip_jacobian(skeleton, self._frames)
        self._slopes = slopes * poses.compared[:, None, None, :]
        self._counts = poses.counts
        self._floors = [floors.get(name) for name in skeleton.rotations]

    def of_tips(self, tips: list[int]) -> FingertipFloor | None:
        """Of some fingertips together; None when some joint's floor is unknown."""
        squares = (self._slopes[:, tips] ** 2).sum(axis=2)[self._counts[:, tips]]
        return self._floor(squares, lambda sizes: float(np.mean(squares @ sizes**2)))

    def of_distance(self, first: int, second: int) -> FingertipFloor | None:
        """Of the distance between two fingertips. Touching tips can only move apart, so noise is drawn."""
        both = self._counts[:, first] & self._counts[:, second]
        slopes = (self._slopes[:, first] - self._slopes[:, second])[both]
        gaps = (self._frames.tips_mm[:, first] - self._frames.tips_mm[:, second])[both]
        drawn = np.random.default_rng(0).standard_normal((len(gaps), len(self._floors)))

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
            all(one is not None and one.is_reliable for one in known),
        )

    def _sizes(self, end: str, moving: np.ndarray) -> np.ndarray:
        pairs = zip(self._floors, moving, strict=True)
        return np.array(
            [getattr(floor, end) if moves and floor is not None else 0.0 for floor, moves in pairs]
        )


@dataclass(frozen=True)
class TipErrors:
    """Distances between where a fingertip is predicted and where it was measured, in mm."""

    count: int
    """Frames, or frames times fingers."""
    rmse_mm: float
    percentile_95_mm: float
    """95 % of the distances are at or below this."""
    baseline_mm: float
    """The error (RMSE) of always answering each rotation's mean angle."""
    floor: FingertipFloor | None
    """How small the RMSE can get; None where some joint's floor is unknown."""
    assumed_equal: tuple[str, ...]
    """Rotations of the chain that were not compared in all of these frames: there they do not count."""


@dataclass(frozen=True)
class WorstTip:
    """The frame in which a fingertip is farthest off, and the two hands in it."""

    finger: str
    error_mm: float
    take: str
    time_s: float
    """Since the start of the take."""
    measured_deg: dict[str, float]
    predicted_deg: dict[str, float]


@dataclass(frozen=True)
class FingertipErrors:
    """Seen from the palm: the wrist does not count."""

    hand_length_mm: float
    is_assumed: bool
    """Nobody measured this hand: the errors are those of a hand of this length."""
    overall: TipErrors
    fingers: dict[str, TipErrors]
    """``thumb`` to ``pinky``, those whose chain was predicted and measured."""
    thumb_index: TipErrors | None
    """Of the distance between the tips of thumb and index finger; None where one of them does not count."""
    worst: WorstTip


def fingertip_errors(
    found: Residuals,
    floors: Mapping[str, NoiseFloor | None],
    dimensions: HandDimensions | None = None,
) -> FingertipErrors | None:
    """Of hands with ``dimensions``; None where no finger's chain was predicted and measured.

    ``floors``: the noise floor of each measured rotation.
    """
    poses = hand_poses(found)
    if poses is None:
        return None
    palm = "arching" if PALM in compared_rotations(found) else "rigid"
    skeleton = hand_skeleton(dimensions, palm=palm)
    answers = (poses.measured, poses.predicted, _always_mean(poses))
    tips = tuple(tips_mm(skeleton, angles) for angles in answers)
    carried = CarriedFloors(skeleton, poses, floors)
    off, mean_off = (_distances(answer, tips[0], poses) for answer in tips[1:])

    def errors(chosen: list[int]) -> TipErrors:
        equal = _assumed_equal(skeleton, poses, chosen)
        return _errors(off[:, chosen], mean_off[:, chosen], carried.of_tips(chosen), equal)

    counting = [tip for tip in range(len(TIPS)) if poses.counts[:, tip].any()]
    fingers = {TIPS[tip]: errors([tip]) for tip in counting}
    overall, thumb_index = errors(counting), _thumb_index(skeleton, poses, tips, carried)
    sizes = skeleton.dimensions
    return FingertipErrors(
        sizes.hand_length_mm, sizes.is_assumed, overall, fingers, thumb_index,
        _worst(off, poses, found, skeleton.rotations),
    )  # fmt: skip


def _thumb_index(
    skeleton: Skeleton, poses: HandPoses, tips: Sequence[np.ndarray], carried: CarriedFloors
) -> TipErrors | None:
    """``tips``: measured, predicted, and those of the mean angles, each (N, 5, 3)."""
    both = poses.counts[:, THUMB] & poses.counts[:, INDEX]
    if not both.any():
        return None
    gap, *answers = (np.linalg.norm(one[both, THUMB] - one[both, INDEX], axis=1) for one in tips)
    off, mean_off = (np.abs(answer - gap) for answer in answers)
    equal = _assumed_equal(skeleton, poses, (THUMB, INDEX))
    return _errors(off, mean_off, carried.of_distance(THUMB, INDEX), equal)


def _distances(tips: np.ndarray, measured: np.ndarray, poses: HandPoses) -> np.ndarray:
    """(N, 5), NaN where a fingertip does not count."""
    return np.where(poses.counts, np.linalg.norm(tips - measured, axis=2), np.nan)


def _always_mean(poses: HandPoses) -> np.ndarray:
    """The hands of one who always answers the mean angle of what was measured."""
    counts = np.maximum(poses.compared.sum(axis=0), 1)
    means = np.where(poses.compared, poses.measured, 0.0).sum(axis=0) / counts
    return np.where(poses.compared, means, poses.measured)


def _errors(
    off: np.ndarray, mean_off: np.ndarray, floor: FingertipFloor | None, assumed_equal: tuple[str, ...]
) -> TipErrors:
    known = off[np.isfinite(off)]
    rmse = float(np.sqrt(np.mean(known**2)))
    return TipErrors(
        count=len(known),
        rmse_mm=rmse,
        percentile_95_mm=float(np.percentile(known, 95)),
        baseline_mm=float(np.sqrt(np.nanmean(mean_off**2))),
        floor=None if floor is None else floor.beside(rmse),
        assumed_equal=assumed_equal,
    )


def _assumed_equal(skeleton: Skeleton, poses: HandPoses, tips: Sequence[int]) -> tuple[str, ...]:
    found = set()
    for tip in tips:
        rows = poses.counts[:, tip]
        for name in skeleton.chain(list(FINGERS)[tip]):
            if not poses.compared[rows, skeleton.rotations.index(name)].all():
                found.add(name)
    return tuple(name for name in skeleton.rotations if name in found)


def _worst(off: np.ndarray, poses: HandPoses, found: Residuals, hand: Sequence[str]) -> WorstTip:
    frame, tip = np.unravel_index(np.nanargmax(off), off.shape)
    take = found.takes[poses.take[frame]].take.name
    measured, predicted = (
        dict(zip(hand, angles[frame].tolist(), strict=True)) for angles in (poses.measured, poses.predicted)
    )
    error, time = float(off[frame, tip]), float(poses.time_s[frame])
    return WorstTip(TIPS[tip], error, take, time, measured, predicted)
