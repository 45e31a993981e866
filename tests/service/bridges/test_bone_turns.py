"""Turns of bones for one frame are those of the kinematics for many."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from glovecal_models.hand.bones import HandBones
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG, HANDS, Handedness
from glovecal_models.hand.skeleton import Palm, hand_skeleton
from glovecal_service.bridges.bone_turns import BoneTurns


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
