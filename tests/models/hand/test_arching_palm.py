"""The little finger's metacarpal as a joint: a hand without it stays what it was, the laws hold with it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from glovecal_models.errors import BadInput
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.forward_kinematics import forward_kinematics, tip_jacobian
from glovecal_models.hand.rotations import (
    ACTIVE_RANGE_DEG,
    ARCHING_ROTATIONS,
    HAND_ROTATIONS,
    PALM,
    WRIST,
    completed,
)
from glovecal_models.hand.skeleton import hand_skeleton, skeleton_document
from glovecal_models.sampling.inverse_kinematics.contact import TipChains, Touch
from glovecal_models.sampling.inverse_kinematics.follow import HandShape, follow

SIZES = HandDimensions.from_measured({"hand_length": 182, "P_metacarpal": 80})
RIGID = hand_skeleton(SIZES)
RIGHT, LEFT = (hand_skeleton(SIZES, hand, "arching") for hand in ("right", "left"))
WILD = arrays(float, (3, len(ARCHING_ROTATIONS)), elements=st.floats(-1e4, 1e4))
MIRROR = np.diag([1.0, -1.0, 1.0])
ARCH = ARCHING_ROTATIONS.index(PALM)


def test_the_rigid_hand_knows_nothing_of_the_joint() -> None:
    assert RIGID.rotations == HAND_ROTATIONS
    assert PALM not in RIGID.chain("P")
    assert PALM not in [item["name"] for item in skeleton_document(RIGID)["rotations"]]
    with pytest.raises(BadInput, match="23"):
        forward_kinematics(RIGID, np.zeros((1, len(ARCHING_ROTATIONS))))


@given(WILD)
@settings(max_examples=30)
def test_with_a_flat_palm_both_hands_are_equal(angles: np.ndarray) -> None:
    angles = angles.copy()
    angles[:, ARCH] = 0.0
    arching, rigid = forward_kinematics(RIGHT, angles), forward_kinematics(RIGID, angles[:, :ARCH])
    np.testing.assert_allclose(arching.tips_mm, rigid.tips_mm, atol=1e-9)
    slopes = tip_jacobian(RIGHT, arching)[..., :ARCH]
    np.testing.assert_allclose(slopes, tip_jacobian(RIGID, rigid), atol=1e-9)


@pytest.mark.parametrize("skeleton", [RIGHT, LEFT], ids=["right", "left"])
def test_the_jacobian_is_the_slope_of_finite_differences(skeleton) -> None:
    angles = np.random.default_rng(5).uniform(-100, 100, (6, len(ARCHING_ROTATIONS)))
    slopes, step = tip_jacobian(skeleton, forward_kinematics(skeleton, angles)), 1e-4
    for rotation in range(len(ARCHING_ROTATIONS)):
        move = step * np.eye(len(ARCHING_ROTATIONS))[rotation]
        ahead, behind = (forward_kinematics(skeleton, angles + sign * move).tips_mm for sign in (1, -1))
        np.testing.assert_allclose(slopes[..., rotation], (ahead - behind) / (2 * step), atol=1e-6)


@given(WILD)
@settings(max_examples=30)
def test_the_left_hand_mirrors_the_right(angles: np.ndarray) -> None:
    right, left = forward_kinematics(RIGHT, angles), forward_kinematics(LEFT, angles)
    np.testing.assert_allclose(left.tips_mm, right.tips_mm @ MIRROR, atol=1e-9)


def test_an_arching_palm_brings_the_little_finger_and_no_other_to_the_thumb() -> None:
    flat, arched = np.zeros((2, 1, len(ARCHING_ROTATIONS)))
    arched[0, ARCH] = ACTIVE_RANGE_DEG[PALM][1]
    before, after = (forward_kinematics(RIGHT, angles) for angles in (flat, arched))
    moved = after.tips_mm[0] - before.tips_mm[0]
    np.testing.assert_allclose(moved[:4], 0.0, atol=1e-12)
    names = [joint.name for joint in RIGHT.joints]
    knuckle = (after.joints_mm - before.joints_mm)[0, names.index("P_MCP")]
    assert -30 < knuckle[2] < -15  # towards the palm, and no further than a palm goes
    slope = tip_jacobian(RIGHT, forward_kinematics(RIGHT, _bent()))[0, 4, :, ARCH]
    assert slope[1] > 0  # a bent little finger goes to the thumb's side


def _bent() -> np.ndarray:
    return completed(["P_MCP", "P_PIP"], np.array([[60.0, 60.0]]), ARCHING_ROTATIONS)


def test_chains_are_the_whole_hand_and_inverse_kinematics_uses_the_joint() -> None:
    chains = TipChains(RIGHT, ("T", "P"))
    assert chains.rotations[-1] == PALM
    assert not set(chains.rotations) & set(WRIST)
    angles = np.random.default_rng(2).uniform(
        chains.limits_deg[:, 0], chains.limits_deg[:, 1], (8, len(chains.rotations))
    )
    whole = np.zeros((8, len(ARCHING_ROTATIONS)))
    whole[:, chains.columns] = angles
    frames = forward_kinematics(RIGHT, whole)
    tips, slopes = chains.tips_and_slopes(angles)
    np.testing.assert_allclose(tips, frames.tips_mm[:, [0, 4]], atol=1e-9)
    expected = tip_jacobian(RIGHT, frames)[:, [0, 4]][..., chains.columns]
    np.testing.assert_allclose(slopes, expected, atol=1e-9)
    found = follow(chains, Touch(("T", "P")), HandShape.at_rest(chains.rotations))
    assert found.missing_mm[0] < 0.01
    assert found.angles_deg[0, -1] > 3.0  # from flat: the palm takes its share of the way


def test_the_document_holds_the_joint_and_a_palm_that_nobody_measured_is_flat() -> None:
    document = skeleton_document(LEFT)
    (rotation,) = [item for item in document["rotations"] if item["name"] == PALM]
    assert rotation == {"name": PALM, "low": 0.0, "high": 25.0, "rule": None, "rest": 0.0}
    joints = {joint["name"]: joint for joint in document["joints"]}
    assert joints["P_ABD"]["parent"] == "P_CMC"
    assert joints["P_CMC"]["rotations"] == {PALM: 1.0}
    assert completed((), np.empty((1, 0)), ARCHING_ROTATIONS)[0, ARCH] == 0.0
    assert completed((PALM,), np.array([[7.0]]), ARCHING_ROTATIONS)[0, ARCH] == 7.0
