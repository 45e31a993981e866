"""How far fingertips are off, in mm: what rotations in degrees come to where the hand touches the world."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.comparison.fingertip_floor import CarriedFloors, FingertipFloor
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.comparison.hand_poses import HandPoses, hand_poses, tips_mm
from glovecal_models.comparison.residuals import Residuals
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.rotations import FINGERS, HAND_ROTATIONS
from glovecal_models.hand.skeleton import Skeleton, hand_skeleton

TIPS = tuple(FINGERS.values())
THUMB, INDEX = 0, 1


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
    taken_equal: tuple[str, ...]
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
    over_all: TipErrors
    fingers: dict[str, TipErrors]
    """``thumb`` to ``pinky``, those whose chain was predicted and measured."""
    thumb_index: TipErrors | None
    """Of the distance between the tips of thumb and index finger; None where one of them does not count."""
    worst: WorstTip
    sentence: str


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
    skeleton = hand_skeleton(dimensions)
    answers = (poses.measured, poses.predicted, _always_mean(poses))
    tips = tuple(tips_mm(skeleton, angles) for angles in answers)
    carried = CarriedFloors(skeleton, poses, floors)
    off, mean_off = (_distances(answer, tips[0], poses) for answer in tips[1:])

    def errors(chosen: list[int]) -> TipErrors:
        equal = _taken_equal(skeleton, poses, chosen)
        return _errors(off[:, chosen], mean_off[:, chosen], carried.of_tips(chosen), equal)

    counting = [tip for tip in range(len(TIPS)) if poses.counts[:, tip].any()]
    fingers = {TIPS[tip]: errors([tip]) for tip in counting}
    over_all, thumb_index = errors(counting), _thumb_index(skeleton, poses, tips, carried)
    sizes = skeleton.dimensions
    return FingertipErrors(
        sizes.hand_length_mm, sizes.is_assumed, over_all, fingers, thumb_index, _worst(off, poses, found),
        _sentence(sizes, over_all, fingers, thumb_index),
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
    equal = _taken_equal(skeleton, poses, (THUMB, INDEX))
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
    off: np.ndarray, mean_off: np.ndarray, floor: FingertipFloor | None, taken_equal: tuple[str, ...]
) -> TipErrors:
    known = off[np.isfinite(off)]
    return TipErrors(
        count=len(known),
        rmse_mm=float(np.sqrt(np.mean(known**2))),
        percentile_95_mm=float(np.percentile(known, 95)),
        baseline_mm=float(np.sqrt(np.nanmean(mean_off**2))),
        floor=floor,
        taken_equal=taken_equal,
    )


def _taken_equal(skeleton: Skeleton, poses: HandPoses, tips: Sequence[int]) -> tuple[str, ...]:
    found = set()
    for tip in tips:
        rows = poses.counts[:, tip]
        for name in skeleton.chain(list(FINGERS)[tip]):
            if not poses.compared[rows, HAND_ROTATIONS.index(name)].all():
                found.add(name)
    return tuple(name for name in HAND_ROTATIONS if name in found)


def _worst(off: np.ndarray, poses: HandPoses, found: Residuals) -> WorstTip:
    frame, tip = np.unravel_index(np.nanargmax(off), off.shape)
    take = found.takes[poses.take[frame]].take.name
    measured, predicted = (
        dict(zip(HAND_ROTATIONS, angles[frame].tolist(), strict=True))
        for angles in (poses.measured, poses.predicted)
    )
    error, time = float(off[frame, tip]), float(poses.time_s[frame])
    return WorstTip(TIPS[tip], error, take, time, measured, predicted)


def _sentence(
    sizes: HandDimensions,
    over_all: TipErrors,
    fingers: Mapping[str, TipErrors],
    thumb_index: TipErrors | None,
) -> str:
    whose = f"for a hand of {sizes.hand_length_mm:.0f} mm"
    whose += ", a size nobody measured" if sizes.is_assumed else ""
    worst = max(fingers, key=lambda name: fingers[name].rmse_mm)
    said = f"Fingertips are off by {over_all.rmse_mm:.1f} mm (RMSE, {whose}{_scale(over_all)})"
    if len(fingers) > 1:
        said += f", most at the {worst} with {fingers[worst].rmse_mm:.1f} mm"
    if thumb_index is not None:
        said += f"; the distance between thumb and index fingertip by {thumb_index.rmse_mm:.1f} mm"
    equal = over_all.taken_equal
    if equal:
        were = "was" if len(equal) == 1 else "were"
        said += f". {_listed(equal)} {were} not measured throughout and taken equal in both"
    return f"{said}."


def _scale(errors: TipErrors) -> str:
    if errors.floor is None:
        return f"; always answering the mean angles {errors.baseline_mm:.1f}"
    least = "at least " if errors.floor.is_lower_bound else ""
    return f"; noise floor {least}{errors.floor.floor_mm:.1f}"


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
