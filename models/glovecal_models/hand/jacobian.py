"""How fingertips move with each rotation."""

from __future__ import annotations

import numpy as np

from glovecal_models.hand.forward_kinematics import HandFrames
from glovecal_models.hand.skeleton import Skeleton


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
