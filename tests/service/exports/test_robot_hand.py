# pyright: reportAttributeAccessIssue=false
"""A hand as URDF and MJCF: MuJoCo reads both, and has joints and fingertips where our kinematics has them."""

from __future__ import annotations

import itertools

import mujoco
import numpy as np
import pytest

from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG, FINGERS, HANDS
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_service.exports.robot_hand import hinges, mjcf, urdf

EACH = pytest.mark.parametrize(("hand", "palm"), list(itertools.product(HANDS, ("rigid", "arching"))))
AGREES_MM = 1e-6


def posed(model: mujoco.MjModel, skeleton, angles_deg: np.ndarray) -> mujoco.MjData:
    data = mujoco.MjData(model)
    by_rotation = dict(zip(skeleton.rotations, np.radians(angles_deg), strict=True))
    for own in hinges(skeleton).values():
        for hinge in own:
            data.qpos[model.joint(hinge.name).qposadr[0]] = by_rotation[hinge.rotation]
    mujoco.mj_kinematics(model, data)
    return data


def random_angles(skeleton) -> np.ndarray:
    low, high = np.array([ACTIVE_RANGE_DEG[name] for name in skeleton.rotations]).T
    return np.random.default_rng(8).uniform(low, high, (20, len(low)))


@EACH
@pytest.mark.parametrize("write", [mjcf, urdf], ids=["mjcf", "urdf"])
def test_joints_are_where_our_kinematics_has_them(hand, palm, write) -> None:
    skeleton = hand_skeleton(hand=hand, palm=palm)
    model = mujoco.MjModel.from_xml_string(write(skeleton))
    for angles in random_angles(skeleton):
        data = posed(model, skeleton, angles)
        frames = forward_kinematics(skeleton, angles[None])
        for place, joint in zip(frames.joints_mm[0], skeleton.joints, strict=True):
            for hinge in hinges(skeleton)[joint.name]:
                seen = 1000 * data.xanchor[model.joint(hinge.name).id]
                np.testing.assert_allclose(seen, place, atol=AGREES_MM, err_msg=hinge.name)


@EACH
def test_fingertips_of_the_mjcf_are_where_our_kinematics_has_them(hand, palm) -> None:
    skeleton = hand_skeleton(hand=hand, palm=palm)
    model = mujoco.MjModel.from_xml_string(mjcf(skeleton))
    for angles in random_angles(skeleton):
        data = posed(model, skeleton, angles)
        tips = forward_kinematics(skeleton, angles[None]).tips_mm[0]
        for tip, place in zip(skeleton.tips, tips, strict=True):
            seen = 1000 * data.site(f"{FINGERS[tip.finger]}_tip").xpos
            np.testing.assert_allclose(seen, place, atol=AGREES_MM)


def test_joint_states_of_the_glove_move_it_by_their_names() -> None:
    skeleton = hand_skeleton()
    model = mujoco.MjModel.from_xml_string(urdf(skeleton))
    names = {model.joint(number).name for number in range(model.njnt)}
    assert set(skeleton.rotations) <= names
    assert names - set(skeleton.rotations) == {"P_ABD_MR_ABD"}, "the little finger follows the ring finger"
    assert '<mimic joint="MR_ABD" multiplier="1" offset="0" />' in urdf(skeleton)


def test_a_simulated_hand_holds_what_mimics_together() -> None:
    model = mujoco.MjModel.from_xml_string(mjcf(hand_skeleton()))
    model.opt.gravity[:] = 0
    data = mujoco.MjData(model)
    data.qpos[model.joint("MR_ABD").qposadr[0]] = 0.3
    for _ in range(2000):
        mujoco.mj_step(model, data)
    spread = (data.qpos[model.joint(name).qposadr[0]] for name in ("MR_ABD", "P_ABD_MR_ABD"))
    assert abs(next(spread) - next(spread)) < 0.02
