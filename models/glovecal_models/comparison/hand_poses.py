"""A prediction and its measurement as two whole hands, frame by frame.

Only what was both predicted and measured may differ between the two. Every other rotation is taken equal in
both: as measured, else as predicted, else by the hand's own rules and rest. The wrist moves the whole hand
and is left straight: fingertips are seen from the palm.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from glovecal_models.comparison.residuals import Residuals, TakeResiduals
from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.rotations import ARCHING_ROTATIONS, FINGERS, HAND_ROTATIONS, PALM, WRIST, completed
from glovecal_models.hand.skeleton import Skeleton

NEEDED = {
    "T": ("T_TMC", "TI_ABD", "T_MCP", "T_IP"),
    **{finger: (f"{finger}_MCP", f"{finger}_PIP") for finger in "IMRP"},
}
"""A fingertip counts in frames where these were predicted and measured."""
FRAMES_AT_ONCE = 4096
_WRIST = [HAND_ROTATIONS.index(name) for name in WRIST]


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
