"""Bones for one frame are those of the kinematics for many; from the T-pose they come to the same places."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from glovecal_models.hand.bones import PHALANGES, HandBones
from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG, HANDS, Handedness
from glovecal_models.hand.skeleton import Palm, hand_skeleton
from glovecal_service.bridges.bone_turns import BoneTurns
from glovecal_service.bridges.t_pose import UNITY_AXES, finger_bones


@pytest.mark.parametrize("hand", HANDS)
@pytest.mark.parametrize("palm", ["rigid", "arching"])
def test_the_same_turns_as_those_of_the_kinematics(hand: Handedness, palm: Palm) -> None:
    bones = HandBones.of(hand_skeleton(None, hand, palm))
    low, high = np.array([ACTIVE_RANGE_DEG[name] for name in bones.skeleton.rotations]).T
    angles_deg = np.random.default_rng(3).uniform(low, high, (20, len(low)))
    turns = BoneTurns(bones)
    for row, orientations in zip(angles_deg, bones.orientations(angles_deg), strict=True):
        for bone, (w, x, y, z) in enumerate(turns.local(row.tolist())):
            parent = bones.parents[bone]
            carrier = np.eye(3) if parent is None else orientations[parent]
            local = Rotation.from_quat([x, y, z, w]).as_matrix()
            np.testing.assert_allclose(carrier @ local, orientations[bone], atol=1e-12)


@pytest.mark.parametrize("hand", HANDS)
@pytest.mark.parametrize("palm", ["rigid", "arching"])
def test_from_the_t_pose_fingers_come_to_the_same_places(hand: Handedness, palm: Palm) -> None:
    bones = HandBones.of(hand_skeleton(None, hand, palm))
    low, high = np.array([ACTIVE_RANGE_DEG[name] for name in bones.skeleton.rotations]).T
    angles_deg = np.random.default_rng(4).uniform(low, high)
    frames = forward_kinematics(bones.skeleton, angles_deg[None])
    wrist, axes = frames.orientations[0, bones.joints[0]], np.array(UNITY_AXES[hand])
    at, turn = np.zeros(3), Rotation.identity()
    for bone in finger_bones(bones, BoneTurns(bones).local(angles_deg.tolist())):
        if bone.part == PHALANGES[bone.finger][0]:
            at, turn = np.zeros(3), Rotation.identity()
        at = at + turn.apply(bone.place_mm)
        w, x, y, z = bone.turn
        turn = turn * Rotation.from_quat([x, y, z, w])
        joint = bones.joints[bones.names.index(f"{bone.finger}_{bone.part}")]
        np.testing.assert_allclose(at, axes @ wrist.T @ frames.joints_mm[0, joint], atol=1e-9)
