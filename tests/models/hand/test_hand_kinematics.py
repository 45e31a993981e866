"""Laws of the hand: rigid bones, orthonormal frames, mirrored hands, derivatives, limits, reach."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import minimize

from glovecal_models.errors import BadInput
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.forward_kinematics import HandFrames, forward_kinematics, tip_jacobian
from glovecal_models.hand.rotations import FINGERS, HAND_ROTATIONS, LIMITS_DEG, REST_DEG, RULES, completed
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.layout import Layout
from glovecal_models.simulation.simulated_hand import POSTURES

RIGHT, LEFT = hand_skeleton(), hand_skeleton(hand="left")
WILD = arrays(float, (3, len(HAND_ROTATIONS)), elements=st.floats(-1e4, 1e4))
MIRROR = np.diag([1.0, -1.0, 1.0])


def posture(name: str) -> np.ndarray:
    """A posture with the wrist straight, (1, R)."""
    angles = {**POSTURES[name], "W_FLEX": 0.0, "W_ABD": 0.0}
    return completed(list(angles), np.array([list(angles.values())]))


def tips_of(angles: np.ndarray) -> dict[str, np.ndarray]:
    return dict(zip(FINGERS, forward_kinematics(RIGHT, angles).tips_mm[0], strict=True))


def bone_lengths(frames: HandFrames) -> np.ndarray:
    """Of every joint to its parent, and of every tip to its joint, (N, bones)."""
    pairs = [(child, parent) for child, parent in enumerate(RIGHT.parents) if parent is not None]
    bones = [frames.joints_mm[:, child] - frames.joints_mm[:, parent] for child, parent in pairs]
    bones += [frames.tips_mm[:, tip] - frames.joints_mm[:, last] for tip, last in enumerate(RIGHT.tip_joints)]
    return np.linalg.norm(np.stack(bones, axis=1), axis=2)


@given(WILD)
@settings(max_examples=40)
def test_frames_stay_orthonormal_and_bones_rigid_whatever_the_angles(angles: np.ndarray) -> None:
    frames = forward_kinematics(RIGHT, angles)
    squares = frames.orientations.swapaxes(-1, -2) @ frames.orientations
    np.testing.assert_allclose(squares, np.broadcast_to(np.eye(3), squares.shape), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(frames.orientations), 1.0, atol=1e-12)
    straight = bone_lengths(forward_kinematics(RIGHT, np.zeros((1, len(HAND_ROTATIONS)))))
    np.testing.assert_allclose(bone_lengths(frames), np.repeat(straight, 3, axis=0), atol=1e-9)


@given(WILD)
@settings(max_examples=40)
def test_the_left_hand_mirrors_the_right(angles: np.ndarray) -> None:
    right, left = forward_kinematics(RIGHT, angles), forward_kinematics(LEFT, angles)
    np.testing.assert_allclose(left.tips_mm, right.tips_mm @ MIRROR, atol=1e-9)
    np.testing.assert_allclose(left.joints_mm, right.joints_mm @ MIRROR, atol=1e-9)
    np.testing.assert_allclose(left.orientations, MIRROR @ right.orientations @ MIRROR, atol=1e-12)


@given(WILD)
@settings(max_examples=20)
def test_many_frames_at_once_equal_each_by_itself(angles: np.ndarray) -> None:
    together = forward_kinematics(RIGHT, angles)
    slopes = tip_jacobian(RIGHT, together)
    for frame in range(len(angles)):
        alone = forward_kinematics(RIGHT, angles[frame : frame + 1])
        np.testing.assert_allclose(alone.tips_mm[0], together.tips_mm[frame], atol=1e-10)
        np.testing.assert_allclose(tip_jacobian(RIGHT, alone)[0], slopes[frame], atol=1e-10)


@pytest.mark.parametrize("skeleton", [RIGHT, LEFT], ids=["right", "left"])
def test_the_jacobian_is_the_slope_of_finite_differences(skeleton) -> None:
    angles = np.random.default_rng(5).uniform(-100, 100, (6, len(HAND_ROTATIONS)))
    slopes = tip_jacobian(skeleton, forward_kinematics(skeleton, angles))
    step = 1e-4
    for rotation in range(len(HAND_ROTATIONS)):
        move = step * np.eye(len(HAND_ROTATIONS))[rotation]
        ahead, behind = (forward_kinematics(skeleton, angles + sign * move).tips_mm for sign in (1, -1))
        np.testing.assert_allclose(slopes[..., rotation], (ahead - behind) / (2 * step), atol=1e-6)


def test_positive_means_bent_and_spread() -> None:
    """Flexion goes into the palm (-z), the spread away from the middle finger, on either hand."""
    flat = np.zeros((1, len(HAND_ROTATIONS)))
    for skeleton, thumbwards in ((RIGHT, 1.0), (LEFT, -1.0)):
        slopes = tip_jacobian(skeleton, forward_kinematics(skeleton, flat))[0]
        by_name = {name: slopes[:, :, HAND_ROTATIONS.index(name)] for name in HAND_ROTATIONS}
        for tip, finger in enumerate(FINGERS):
            if finger != "T":
                assert all(by_name[f"{finger}_{joint}"][tip, 2] < 0 for joint in ("MCP", "PIP", "DIP"))
        assert by_name["IM_ABD"][1, 1] * thumbwards > 0 > by_name["MR_ABD"][3, 1] * thumbwards
        assert by_name["TI_ABD"][0, 1] * thumbwards > 0
        assert by_name["W_ABD"][2, 1] * thumbwards > 0 > by_name["W_FLEX"][2, 2]


def test_each_rotation_moves_its_own_fingers_only() -> None:
    assert RIGHT.chain("P") == ("MR_ABD", "RP_ABD", "P_MCP", "P_PIP", "P_DIP")
    assert RIGHT.chain("T") == ("T_TMC", "TI_ABD", "T_VIR", "T_MCP", "T_IP")
    angles = np.random.default_rng(1).uniform(LIMITS_DEG[:, 0], LIMITS_DEG[:, 1], (4, len(HAND_ROTATIONS)))
    slopes = tip_jacobian(RIGHT, forward_kinematics(RIGHT, angles))
    for tip, finger in enumerate(FINGERS):
        moving = np.abs(slopes[:, tip]).max(axis=(0, 1)) > 1e-12
        named = {name for name, moves in zip(HAND_ROTATIONS, moving, strict=True) if moves}
        assert named == {*RIGHT.chain(finger), "W_ABD", "W_FLEX"}


def test_a_straight_middle_finger_ends_one_hand_length_from_the_wrist() -> None:
    for length in (100.0, 190.0, 250.0):
        skeleton = hand_skeleton(HandDimensions.from_measured({"hand_length": length}))
        tips = forward_kinematics(skeleton, np.zeros((1, len(HAND_ROTATIONS)))).tips_mm[0]
        assert tips[2] == pytest.approx([length, 0, 0], rel=0.002, abs=1e-9)


def test_a_hand_twice_as_long_is_twice_as_large() -> None:
    angles = np.random.default_rng(2).uniform(LIMITS_DEG[:, 0], LIMITS_DEG[:, 1], (5, len(HAND_ROTATIONS)))
    small, large = (
        forward_kinematics(hand_skeleton(HandDimensions.from_measured({"hand_length": length})), angles)
        for length in (100.0, 200.0)
    )
    np.testing.assert_allclose(large.tips_mm, 2 * small.tips_mm, atol=1e-9)


@pytest.mark.parametrize("finger", ["I", "M", "R", "P"])
def test_the_thumb_can_touch_every_fingertip_within_the_limits(finger: str) -> None:
    free = [HAND_ROTATIONS.index(name) for one in ("T", finger) for name in RIGHT.chain(one)]
    start = posture("ok")[0]

    def apart(chosen: np.ndarray) -> tuple[float, np.ndarray]:
        angles = start.copy()
        angles[free] = chosen
        frames = forward_kinematics(RIGHT, angles[None])
        gap = frames.tips_mm[0, 0] - frames.tips_mm[0, list(FINGERS).index(finger)]
        slopes = tip_jacobian(RIGHT, frames)[0]
        slope = (slopes[0] - slopes[list(FINGERS).index(finger)])[:, free]
        return float(gap @ gap), 2 * gap @ slope

    found = minimize(apart, start[free], jac=True, bounds=LIMITS_DEG[free], tol=1e-12)
    assert np.sqrt(found.fun) < 0.1


def test_postures_look_like_what_they_are_called() -> None:
    ok, fist, flat, rest = (tips_of(posture(name)) for name in ("ok", "fist", "flat", "rest"))
    assert np.linalg.norm(ok["T"] - ok["I"]) < 10
    assert min(np.linalg.norm(ok["T"] - ok[finger]) for finger in "MRP") > 40
    knuckles = 0.446 * RIGHT.dimensions.hand_length_mm
    assert all(fist[finger][0] < knuckles and fist[finger][2] < -20 for finger in "IMRP")
    assert all(flat[finger][0] > 1.6 * knuckles for finger in "IMR")
    assert flat["T"][1] > flat["I"][1] > flat["M"][1] > flat["R"][1] > flat["P"][1]
    assert all(fist[finger][0] < rest[finger][0] < flat[finger][0] for finger in "IMRP")


def test_the_relaxed_thumb_is_pronated_as_anatomy_says() -> None:
    """80 degrees to the middle metacarpal at its base (Cooney et al. 1981, median of ten specimens)."""
    names = [joint.name for joint in RIGHT.joints]
    frame = forward_kinematics(RIGHT, posture("rest")).orientations[0, names.index("T_VIR")]
    nail = frame[:, 2]
    assert np.degrees(np.arctan2(nail[1], nail[2])) == pytest.approx(80, abs=10)


def test_the_spread_thumb_turns_into_the_palm() -> None:
    frames = forward_kinematics(RIGHT, posture("spread"))
    slope = tip_jacobian(RIGHT, frames)[0, 0, :, HAND_ROTATIONS.index("T_TMC")]
    assert slope[2] < 0 > slope[1]


def test_missing_rotations_follow_their_rule_or_rest() -> None:
    angles = completed(["I_PIP", "T_TMC", "PALM_ARCH"], np.array([[60.0, 30.0, 9.0], [np.nan, 30.0, 9.0]]))
    both = [dict(zip(HAND_ROTATIONS, row, strict=True)) for row in angles]
    assert both[0]["I_DIP"] == pytest.approx(40.0)
    assert both[1]["I_PIP"] == REST_DEG["I_PIP"]
    assert both[1]["I_DIP"] == pytest.approx(REST_DEG["I_PIP"] * 2 / 3)
    assert both[0]["T_VIR"] == pytest.approx(0.5 * 30.0 + 0.5 * REST_DEG["TI_ABD"])
    assert completed(["I_DIP"], np.array([[12.0]]))[0, HAND_ROTATIONS.index("I_DIP")] == 12.0


def test_layouts_without_a_sensor_for_it_follow_the_same_rules() -> None:
    layout = Layout.built_in("cyberglove18")
    for rotation, weights in RULES.items():
        simulated = layout.correspondence(rotation).simulated
        assert simulated is not None
        names = tuple(weights)
        np.testing.assert_allclose(simulated.weights(names), [weights[name] for name in names])


def test_the_relaxed_hand_keeps_the_limits() -> None:
    rest = completed([], np.zeros((1, 0)))
    assert ((rest >= LIMITS_DEG[:, 0]) & (rest <= LIMITS_DEG[:, 1])).all()


def test_angles_of_the_wrong_shape_or_missing_are_refused() -> None:
    with pytest.raises(BadInput, match=r"shape \(3,\)"):
        forward_kinematics(RIGHT, np.zeros(3))
    angles = np.zeros((2, len(HAND_ROTATIONS)))
    angles[1, HAND_ROTATIONS.index("I_MCP")] = np.nan
    with pytest.raises(BadInput, match="I_MCP is nan in frame 1"):
        forward_kinematics(RIGHT, angles)
    with pytest.raises(BadInput, match=r"expected \(N, 2\)"):
        completed(["I_MCP", "I_PIP"], np.zeros((4, 3)))
