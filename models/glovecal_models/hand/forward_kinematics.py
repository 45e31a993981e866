"""Where joints and fingertips are, of many frames at once, and how fingertips move with each rotation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.skeleton import Skeleton


@dataclass(frozen=True)
class HandFrames:
    """N hands in the forearm's frame; joints and tips in the skeleton's order."""

    orientations: np.ndarray
    """(N, J, 3, 3): columns are the axes of each joint's frame, its own turn in it."""
    joints_mm: np.ndarray
    """(N, J, 3)."""
    tips_mm: np.ndarray
    """(N, 5, 3): thumb, index, middle, ring, pinky."""


def forward_kinematics(skeleton: Skeleton, angles_deg: np.ndarray) -> HandFrames:
    """The hands with ``angles_deg`` (N, R), in the order of ``skeleton.rotations``.

    Raises BadInput for another shape, and for angles that are not finite.
    """
    angles = np.asarray(angles_deg, dtype=float)
    if angles.ndim != 2 or angles.shape[1] != len(skeleton.rotations):
        raise BadInput(f"angles have shape {angles.shape}, expected (N, {len(skeleton.rotations)})")
    if not np.isfinite(angles).all():
        frame, rotation = np.argwhere(~np.isfinite(angles))[0]
        value = angles[frame, rotation]
        raise BadInput(
            f"{skeleton.rotations[rotation]} is {value} in frame {frame}; a hand needs every angle"
        )
    turns = np.radians(angles) @ skeleton.weights.T
    count = len(angles)
    orientations = np.empty((count, len(skeleton.joints), 3, 3))
    places = np.empty((count, len(skeleton.joints), 3))
    for index, parent in enumerate(skeleton.parents):
        turned, offset = _turned(skeleton, index, turns[:, index]), skeleton.offsets_mm[index]
        if parent is None:
            places[:, index], orientations[:, index] = offset, turned
            continue
        carrier = orientations[:, parent]
        places[:, index] = places[:, parent] + carrier @ offset
        orientations[:, index] = carrier @ turned
    last = list(skeleton.tip_joints)
    offsets = np.array([tip.offset_mm for tip in skeleton.tips])
    tips = places[:, last] + np.einsum("nfij,fj->nfi", orientations[:, last], offsets)
    return HandFrames(orientations, places, tips)


def _turned(skeleton: Skeleton, joint: int, angles: np.ndarray) -> np.ndarray:
    """Orientation in the parent's frame at ``angles`` (N,) radians, (N, 3, 3): Rodrigues' formula."""
    oriented, sine_part, cosine_part = skeleton.turns[joint]
    return (
        oriented
        + np.sin(angles)[:, None, None] * sine_part
        + (1 - np.cos(angles))[:, None, None] * cosine_part
    )


def tip_jacobian(skeleton: Skeleton, frames: HandFrames) -> np.ndarray:
    """Derivative of the fingertips by the rotations, (N, 5, 3, R), mm per degree.

    A joint turns whatever hangs on it about its axis: a tip moves by axis x (tip - joint) per radian.
    """
    axes = np.einsum("njab,jb->nja", frames.orientations, skeleton.axes)
    by_joint = np.zeros((len(axes), len(skeleton.tips), 3, len(skeleton.joints)))
    for tip, last in enumerate(skeleton.tip_joints):
        chain = list(skeleton.carrying(last))
        arms = frames.tips_mm[:, tip, None] - frames.joints_mm[:, chain]
        by_joint[:, tip][:, :, chain] = np.cross(axes[:, chain], arms).swapaxes(1, 2)
    return np.radians(by_joint @ skeleton.weights)
