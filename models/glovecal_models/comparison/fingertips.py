"""Errors of fingertip positions in mm, and their noise floor.

Each joint's noise floor moves the tip by its column of the Jacobian; the joints' noises are assumed
independent, so their squares add up. Neighbours that share a sensor's noise are not quite independent.

A prediction and its measurement as two whole hands, frame by frame.

Only what was both predicted and measured may differ between the two. Every other rotation is taken equal in
both: as measured, else as predicted, else by the hand's own rules and rest. The wrist moves the whole hand
and is left straight: fingertips are seen from the palm.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.comparison.fingertip_answer import (
    FingertipErrors,
    FingertipFloor,
    HandLines,
    TipErrors,
    WorstTip,
)
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.comparison.residuals import Residuals, TakeResiduals
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.forward_kinematics import forward_kinematics, tip_jacobian
from glovecal_models.hand.rotations import ARCHING_ROTATIONS, FINGERS, HAND_ROTATIONS, PALM, WRIST, completed
from glovecal_models.hand.skeleton import Skeleton, hand_skeleton

NEEDED = {
    "T": ("T_TMC", "TI_ABD", "T_MCP", "T_IP"),
    **{finger: (f"{finger}_MCP", f"{finger}_PIP") for finger in "IMRP"},
}
"""A fingertip counts in frames where these were predicted and measured."""
FRAMES_AT_ONCE = 4096
_WRIST = [HAND_ROTATIONS.index(name) for name in WRIST]
MOST_FRAMES = 3000
"""Frames that the floor is averaged over, spread over all."""
_ENDS = ("floor_deg", "low_deg", "high_deg")
TIPS = tuple(FINGERS.values())
THUMB, INDEX = 0, 1


@dataclass(frozen=True)
class HandPoses:
    """N frames, and R rotations in the order of the hand's, which ``compared_rotations`` tells."""

    predicted: np.ndarray
    """(N, R), degrees."""
    measured: np.ndarray
    """(N, R), degrees."""
    compared: np.ndarray
    """(N, R): predicted and measured; elsewhere both hands are equal."""
    counts: np.ndarray
    """(N, 5): fingertips that count, in the order of ``FINGERS``."""
    take: np.ndarray
    """(N,): index into the residuals' takes."""
    time_s: np.ndarray
    """(N,): since the start of the take."""

    def every(self, most: int) -> HandPoses:
        """At most ``most`` frames, evenly spread."""
        return self.at(slice(None, None, max(1, -(-len(self.time_s) // most))))

    def at(self, rows: slice | np.ndarray) -> HandPoses:
        """Some frames: a slice, a mask or indexes."""
        return HandPoses(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


def compared_rotations(found: Residuals) -> tuple[str, ...]:
    """Of a hand whose palm arches where its arch was both predicted and measured, else of a rigid one."""
    arches = PALM in found.rotations and any(
        np.isfinite(item.take.reference_at_frames((PALM,))).any() for item in found.takes
    )
    return ARCHING_ROTATIONS if arches else HAND_ROTATIONS


def hand_poses(found: Residuals) -> HandPoses | None:
    """Both hands, where a fingertip counts; None where no finger's chain was predicted and measured."""
    hand = compared_rotations(found)
    takes = [poses_of_take(item, found.rotations, index, hand) for index, item in enumerate(found.takes)]
    counting = [one.at(np.flatnonzero(one.counts.any(axis=1))) for one in takes]
    names = HandPoses.__dataclass_fields__
    joined = HandPoses(*(np.concatenate([getattr(one, name) for one in counting]) for name in names))
    return joined if len(joined.time_s) else None


def poses_of_take(
    item: TakeResiduals, rotations: tuple[str, ...], index: int = 0, hand: tuple[str, ...] = HAND_ROTATIONS
) -> HandPoses:
    """Every frame of a take, those too in which no fingertip counts; ``rotations``: of the residuals,
    ``hand``: of the hand."""
    measured = item.take.reference_at_frames(hand)
    predicted = np.full_like(measured, np.nan)
    for column, name in enumerate(hand):
        if name in rotations:
            angle = item.predicted[:, rotations.index(name)]
            predicted[:, column] = np.where(np.isfinite(angle), angle, np.nan)
    compared = np.isfinite(measured) & np.isfinite(predicted)
    compared[:, _WRIST] = False
    places = [[HAND_ROTATIONS.index(name) for name in NEEDED[finger]] for finger in FINGERS]
    counts = np.column_stack([compared[:, needed].all(axis=1) for needed in places])
    whole = completed(hand, np.where(np.isfinite(measured), measured, predicted), hand)
    whole[:, _WRIST] = 0.0
    time = item.take.time_s - item.take.time_s[:1]
    return HandPoses(
        np.where(compared, predicted, whole), whole, compared, counts, np.full(len(time), index), time
    )


def tips_mm(skeleton: Skeleton, angles_deg: np.ndarray) -> np.ndarray:
    """Fingertips (N, 5, 3) of any number of frames."""
    return np.concatenate([forward_kinematics(skeleton, block).tips_mm for block in _blocks(angles_deg)])


def _blocks(angles: np.ndarray) -> Iterator[np.ndarray]:
    for start in range(0, max(len(angles), 1), FRAMES_AT_ONCE):
        yield angles[start : start + FRAMES_AT_ONCE]


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
        _worst(off, poses, found, skeleton),
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


def _worst(off: np.ndarray, poses: HandPoses, found: Residuals, skeleton: Skeleton) -> WorstTip:
    frame, tip = np.unravel_index(np.nanargmax(off), off.shape)
    take = found.takes[poses.take[frame]].take.name
    both = [angles[frame] for angles in (poses.measured, poses.predicted)]
    measured, predicted = (dict(zip(skeleton.rotations, one.tolist(), strict=True)) for one in both)
    lines = [_lines(skeleton, one) for one in both]
    error, time = float(off[frame, tip]), float(poses.time_s[frame])
    return WorstTip(TIPS[tip], error, take, time, measured, predicted, *lines)


def _lines(skeleton: Skeleton, angles_deg: np.ndarray) -> HandLines:
    """Palm to tip of each finger, and across the knuckles, of one frame (R,)."""
    frames = forward_kinematics(skeleton, angles_deg[None])
    fingers = [
        np.vstack([frames.joints_mm[0, list(skeleton.carrying(last))], frames.tips_mm[0, tip]])
        for tip, last in enumerate(skeleton.tip_joints)
    ]
    names = [joint.name for joint in skeleton.joints]
    knuckles = frames.joints_mm[0, [names.index(f"{finger}_MCP") for finger in "IMRP"]]
    return [[(x, y, z) for x, y, z in line.round(2).tolist()] for line in (*fingers, knuckles)]
