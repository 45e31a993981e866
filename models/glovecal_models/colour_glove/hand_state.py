"""All that a picture of a hand depends on: twenty angles of the fingers, and the palm's place and turn.

26 degrees of freedom as in Wang & Popovic 2009, section 5.1. The wrist does not count: its angles are zero,
so that the palm's frame is that of ``hand_skeleton`` (origin at the wrist, x to the fingers, y to the thumb
of the right hand, z out of the back of the hand). Frame of a camera: x right, y down, z forward, mm.

What is said about a hand's pose in one moment: the state, how sure each part of it is, what was seen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG, HAND_ROTATIONS, WRIST
from glovecal_models.takes.camera_estimates import CameraEstimates, without_repeats

FINGER_ROTATIONS: tuple[str, ...] = tuple(name for name in HAND_ROTATIONS if name not in WRIST)
"""The order of a state's angles: ``HAND_ROTATIONS`` without the wrist, 20."""
RANGE_DEG = np.array([ACTIVE_RANGE_DEG[name] for name in FINGER_ROTATIONS])
"""Lowest and highest angle, (20, 2)."""
DEGREES_OF_FREEDOM = len(FINGER_ROTATIONS) + 6
_IS_ROTATION_WITHIN = 1e-6
_SMALL_RAD, _NEARLY_OPPOSITE = 1e-6, -0.9
STAGES = ("nearest", "blend", "ik", "dense")
"""The nearest entry of the database; ten of them blended (section 4.5); inverse kinematics on the patches'
centroids (section 5.3); refinement on the labels of all pixels (ours). Each starts from the one before."""


@dataclass(frozen=True, eq=False)
class HandState:
    """One hand before a camera. Raises BadInput for other shapes, values that are not finite, and a matrix
    that is no rotation."""

    angles_deg: np.ndarray
    """(20,), in the order of ``FINGER_ROTATIONS``."""
    rotation: np.ndarray
    """(3, 3), from the palm's frame to the camera's."""
    position_mm: np.ndarray
    """(3,), the wrist in the camera's frame."""

    def __post_init__(self) -> None:
        shapes = {"angles_deg": (len(FINGER_ROTATIONS),), "rotation": (3, 3), "position_mm": (3,)}
        for name, shape in shapes.items():
            value = np.asarray(getattr(self, name), dtype=float)
            if value.shape != shape:
                raise BadInput(f"{name} of a hand's state has shape {value.shape}, expected {shape}")
            if not np.isfinite(value).all():
                raise BadInput(f"{name} of a hand's state is not finite: {value}")
            object.__setattr__(self, name, value)
        error = np.abs(self.rotation @ self.rotation.T - np.eye(3)).max()
        if error > _IS_ROTATION_WITHIN or np.linalg.det(self.rotation) < 0:
            raise BadInput(f"rotation of a hand's state is no rotation matrix (off by {error:.2g})")

    def vector(self) -> np.ndarray:
        """(26,): angles in degrees, rotation vector in degrees, position in mm."""
        from scipy.spatial.transform import Rotation

        turn = Rotation.from_matrix(self.rotation).as_rotvec(degrees=True)
        return np.concatenate([self.angles_deg, turn, self.position_mm])

    def moved(self, step: np.ndarray) -> HandState:
        """This state after a small step (26,): angles and position are added to, the palm turns about the
        camera's axes (rotation vector in degrees, multiplied from the left). Limited to no range."""
        step = np.asarray(step, dtype=float)
        turned = _turn(np.radians(step[20:23])) @ self.rotation
        return HandState(self.angles_deg + step[:20], turned, self.position_mm + step[23:])

    def step_from(self, other: HandState) -> np.ndarray:
        """(26,): the step that moves ``other`` here, the inverse of ``moved``."""
        turn = np.degrees(_rotation_vector(self.rotation @ other.rotation.T))
        apart = self.position_mm - other.position_mm
        return np.concatenate([self.angles_deg - other.angles_deg, turn, apart])

    def within_range(self) -> HandState:
        """The nearest state whose angles a healthy hand reaches (``hand_ranges``)."""
        return HandState(np.clip(self.angles_deg, *RANGE_DEG.T), self.rotation, self.position_mm)


def _turn(vector: np.ndarray) -> np.ndarray:
    """(3, 3) by Rodrigues' formula, of a rotation vector (3,) in radians: scipy's takes ten times as long."""
    x, y, z = vector
    angle = math.sqrt(x * x + y * y + z * z)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if angle < _SMALL_RAD:
        return np.eye(3) + cross + 0.5 * cross @ cross
    by_sine, by_versine = math.sin(angle) / angle, 2.0 * (math.sin(0.5 * angle) / angle) ** 2
    return np.eye(3) + by_sine * cross + by_versine * (cross @ cross)


def _rotation_vector(turn: np.ndarray) -> np.ndarray:
    """The inverse of ``_turn``, up to half a circle."""
    (a, b, c), (d, e, f), (g, h, i) = turn.tolist()
    x, y, z = 0.5 * (h - f), 0.5 * (c - g), 0.5 * (d - b)
    sine, cosine = math.sqrt(x * x + y * y + z * z), 0.5 * (a + e + i - 1.0)
    if cosine < _NEARLY_OPPOSITE:  # the axis is not to be had from the sines there
        from scipy.spatial.transform import Rotation

        return Rotation.from_matrix(turn).as_rotvec()
    return np.array([x, y, z]) * (math.atan2(sine, cosine) / sine if sine > _SMALL_RAD else 1.0)


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
