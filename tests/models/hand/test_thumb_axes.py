"""The thumb's post-rotation: each sensor turns one axis, ours is the skeleton's, the left is mirrored."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from glovecal_models.errors import BadInput
from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.rotations import HAND_ROTATIONS
from glovecal_models.hand.skeleton import ORDERS, PAPER_DEG, SENSOR_AXES, ThumbAxes, hand_skeleton

ANGLE = st.floats(-80, 80)
POSTURES = np.random.default_rng(6).uniform(0, 60, (5, len(HAND_ROTATIONS)))
MIRROR = np.diag([1.0, -1.0, 1.0])


@pytest.mark.parametrize("order", ORDERS)
def test_ours_said_as_a_post_rotation_is_the_same_hand(order: str) -> None:
    axes = ThumbAxes.rotated(SENSOR_AXES.angles_deg(order), order)
    before, after = (forward_kinematics(hand_skeleton(thumb=each), POSTURES) for each in (None, axes))
    np.testing.assert_allclose(after.tips_mm, before.tips_mm, atol=1e-9)


@given(st.tuples(ANGLE, ANGLE, ANGLE), st.sampled_from(ORDERS))
@settings(max_examples=40)
def test_both_axes_are_of_one_frame_and_angles_come_back(
    angles: tuple[float, float, float], order: str
) -> None:
    axes = ThumbAxes.rotated(angles, order)
    assert np.linalg.norm(axes.roll) == pytest.approx(1)
    assert np.dot(axes.roll, axes.abduction) == pytest.approx(0, abs=1e-12)
    np.testing.assert_allclose(axes.angles_deg(order), angles, atol=1e-6)


def test_each_sensor_turns_one_axis_of_the_frame_and_the_left_hand_is_mirrored() -> None:
    axes = ThumbAxes.rotated(PAPER_DEG, "XYZ")
    right, left = (hand_skeleton(hand=hand, thumb=axes) for hand in ("right", "left"))
    place = [joint.name for joint in right.joints].index("T_TMC")
    still, rolled = np.zeros((2, 1, len(HAND_ROTATIONS)))
    rolled[0, HAND_ROTATIONS.index("T_TMC")] = 25.0
    frames = [forward_kinematics(right, each).orientations[0, place] for each in (still, rolled)]
    turned = Rotation.from_matrix(frames[0].T @ frames[1]).as_rotvec(degrees=True)
    np.testing.assert_allclose(turned, 25.0 * np.array(axes.roll), atol=1e-9)
    tips = [forward_kinematics(each, POSTURES).tips_mm for each in (left, right)]
    np.testing.assert_allclose(tips[0], tips[1] @ MIRROR, atol=1e-9)


def test_the_paper_leaves_the_order_open_and_it_matters() -> None:
    rolls = np.array([ThumbAxes.rotated(PAPER_DEG, order).roll for order in ORDERS])
    apart = np.degrees(np.arccos(np.clip(rolls @ rolls.T, -1, 1)))
    assert apart.max() > 10


def test_what_is_no_post_rotation_is_refused() -> None:
    with pytest.raises(BadInput, match="order of the thumb's turns is 'xyz'"):
        ThumbAxes.rotated(PAPER_DEG, "xyz")
    with pytest.raises(BadInput, match="expected three angles"):
        ThumbAxes.rotated((1.0, float("nan"), 2.0), "XYZ")
