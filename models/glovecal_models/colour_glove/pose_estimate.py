"""What is said about a hand's pose in one moment: the state, how sure each part of it is, what was seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.colour_glove.hand_state import DEGREES_OF_FREEDOM, FINGER_ROTATIONS, HandState
from glovecal_models.errors import BadInput
from glovecal_models.takes.camera_reference.estimates import CameraEstimates, without_repeats

STAGES = ("nearest", "blend", "ik", "dense")
"""The nearest entry of the database; ten of them blended (section 4.5); inverse kinematics on the patches'
centroids (section 5.3); refinement on the labels of all pixels (ours). Each starts from the one before."""


@dataclass(frozen=True, eq=False)
class PoseEstimate:
    """Raises BadInput for arrays of other shapes and a stage that is none of ``STAGES``."""

    state: HandState
    """In the frame of the first camera."""
    standard_deviation: np.ndarray
    """(26,): angles in degrees, turn about the camera's axes in degrees, position in mm."""
    accepted: np.ndarray
    """(20,) bool, in the order of ``FINGER_ROTATIONS``: sure enough to be a reference."""
    patches: tuple[int, ...]
    """Patches (1 to 20) that at least one camera saw."""
    disagreeing: float
    """Share of the pixels of glove, seen or drawn, whose colour is not that of the estimate drawn: 0 to 1."""
    stage: str

    def __post_init__(self) -> None:
        if self.standard_deviation.shape != (DEGREES_OF_FREEDOM,):
            raise BadInput(f"standard deviations have shape {self.standard_deviation.shape}, expected (26,)")
        if self.accepted.shape != (len(FINGER_ROTATIONS),):
            raise BadInput(f"accept flags have shape {self.accepted.shape}, expected (20,)")
        if self.stage not in STAGES:
            raise BadInput(f"stage {self.stage!r} is none of {', '.join(STAGES)}")


def camera_estimates(
    seconds: Sequence[float], poses: Sequence[PoseEstimate | None], *, simulated: bool
) -> CameraEstimates:
    """Estimates over time as a take's reference asks for them; ``seconds`` (F,): the middle of each exposure.

    Where no hand was found (None) there are no angles. Frames that are stamped no later than one before are
    left out. ``simulated``: the pictures were rendered. Raises BadInput where nothing is left.
    """
    time = np.asarray(seconds, dtype=float)
    kept = np.flatnonzero(without_repeats(time))
    angles, deviations = np.full((2, len(kept), len(FINGER_ROTATIONS)), np.nan)
    accepted, patches = np.zeros(angles.shape, dtype=bool), np.zeros(len(kept), dtype=int)
    for row, place in enumerate(kept.tolist()):
        pose = poses[place]
        if pose is not None:
            angles[row] = pose.state.angles_deg
            deviations[row] = pose.standard_deviation[: len(FINGER_ROTATIONS)]
            accepted[row], patches[row] = pose.accepted, len(pose.patches)
    return CameraEstimates(
        time[kept], FINGER_ROTATIONS, angles, deviations, accepted, patches, simulated=simulated
    )
