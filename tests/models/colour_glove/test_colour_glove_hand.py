"""The hand before the camera: its 26 numbers, its skin against forward kinematics, left and other hands."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from glovecal_models.colour_glove.hand_state import FINGER_ROTATIONS, RANGE_DEG, HandState
from glovecal_models.colour_glove.pattern import glove_pattern
from glovecal_models.colour_glove.skin import HandSkin, hand_skin, posed
from glovecal_models.errors import BadInput
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.forward_kinematics import HandFrames, forward_kinematics
from glovecal_models.hand.rotations import HAND_ROTATIONS
from glovecal_models.hand.skeleton import hand_skeleton


def drawn(seed: int) -> HandState:
    rng = np.random.default_rng(seed)
    return HandState(rng.uniform(*RANGE_DEG.T), Rotation.random(rng=rng).as_matrix(), rng.normal(0, 300, 3))


def frames(skin: HandSkin, angles: np.ndarray) -> HandFrames:
    all_angles = [dict(zip(FINGER_ROTATIONS, angles, strict=True)).get(name, 0.0) for name in HAND_ROTATIONS]
    return forward_kinematics(skin.skeleton, np.array([all_angles]))


def test_a_step_turns_the_palm_about_the_cameras_axes():
    state, step = drawn(1), np.zeros(26)
    step[22] = 90.0
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    assert np.allclose(state.moved(step).rotation, quarter @ state.rotation)


@pytest.mark.parametrize(
    ("angles", "rotation", "position", "named"),
    [
        (np.zeros(19), np.eye(3), np.zeros(3), "angles_deg"),
        (np.zeros(20), np.eye(3), np.array([0, np.nan, 0]), "position_mm"),
        (np.zeros(20), np.diag([1, 1, -1.0]), np.zeros(3), "no rotation"),
        (np.zeros(20), 2 * np.eye(3), np.zeros(3), "no rotation"),
    ],
)
def test_no_state_of_a_hand_is_refused(angles, rotation, position, named):
    with pytest.raises(BadInput, match=named):
        HandState(angles, rotation, position)


@settings(max_examples=20)
@given(st.integers(0, 10_000), st.sampled_from(["right", "left"]))
def test_skin_bound_to_one_joint_moves_with_it(seed, hand):
    skin, state = hand_skin(hand_skeleton(hand=hand)), drawn(seed)
    rest, now = frames(skin, skin.rest_deg), frames(skin, state.angles_deg)
    found = (posed(skin, state) - state.position_mm) @ state.rotation
    bound = np.flatnonzero(skin.weights[:, 0] == 1.0)
    assert len(bound) > 500
    joint = skin.joints[bound, 0]
    local = np.einsum(
        "vba,vb->va", rest.orientations[0, joint], skin.vertices_mm[bound] - rest.joints_mm[0, joint]
    )
    moved = np.einsum("vab,vb->va", now.orientations[0, joint], local) + now.joints_mm[0, joint]
    assert np.allclose(found[bound], moved, atol=1e-6)


def test_every_fingertip_lies_in_its_skin():
    skin, state = hand_skin(), drawn(5)
    tips = frames(skin, state.angles_deg).tips_mm[0] @ state.rotation.T + state.position_mm
    distance = np.linalg.norm(posed(skin, state)[None] - tips[:, None], axis=2).min(axis=1)
    assert (distance < 4.0).all()


def test_the_left_hand_is_the_mirror_image():
    right, left, state = hand_skin(), hand_skin(hand_skeleton(hand="left")), drawn(3)
    here = HandState(state.angles_deg, np.eye(3), np.zeros(3))
    assert np.allclose(posed(left, here), posed(right, here) * (1, -1, 1), atol=1e-9)
    assert volume(left) == pytest.approx(volume(right))
    assert volume(right) > 2e5


def volume(skin: HandSkin) -> float:
    a, b, c = (skin.vertices_mm[skin.triangles[:, corner]] for corner in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def test_a_hand_twice_as_long_is_twice_as_large_everywhere():
    sizes = HandDimensions.from_measured({}).sizes_mm
    larger = hand_skin(hand_skeleton(HandDimensions.from_measured({n: 1.4 * s for n, s in sizes.items()})))
    assert np.allclose(larger.vertices_mm, 1.4 * hand_skin().vertices_mm, atol=1e-9)


def test_a_longer_bone_moves_only_what_lies_beyond_its_beginning():
    sizes = HandDimensions.from_measured({}).sizes_mm
    longer = dict(sizes) | {"I_proximal": sizes["I_proximal"] * 1.2}
    usual, other = hand_skin(), hand_skin(hand_skeleton(HandDimensions.from_measured(longer)))
    moved = np.linalg.norm(other.vertices_mm - usual.vertices_mm, axis=1)
    far = usual.joints[:, 0] == [joint.name for joint in usual.skeleton.joints].index("I_DIP")
    assert moved[far].min() > 5.0
    others = [joint.name[0] in "MRP" for joint in usual.skeleton.joints]
    assert moved[np.array(others)[usual.joints[:, 0]]].max() < 0.5
    assert np.array_equal(other.triangles, usual.triangles)


def test_radii_are_what_they_are_asked_to_be():
    thick = hand_skin(radii_mm={"M_middle": (14.0, 14.0)})
    names = [joint.name for joint in thick.skeleton.joints]
    here = (thick.joints[:, 0] == names.index("M_PIP")) & (thick.weights[:, 0] > 0.9)
    width = np.ptp(thick.vertices_mm[here, 1])
    usual = np.ptp(hand_skin().vertices_mm[here, 1])
    assert width > 1.4 * usual
    for radii, named in [
        ({"X": (1, 1)}, "no bone"),
        ({"M_middle": (0, 1)}, "above 0"),
        ({"M_middle": (1,)}, "two"),
    ]:
        with pytest.raises(BadInput, match=named):
            hand_skin(radii_mm=radii)
    with pytest.raises(BadInput, match="arches"):
        hand_skin(hand_skeleton(palm="arching"))


def test_a_pattern_has_twenty_whole_patches_and_two_of_each_colour():
    skin = hand_skin()
    pattern = glove_pattern(skin)
    assert set(pattern.patch) == set(range(1, 21))
    assert sorted(np.bincount(pattern.colour_of_patch)[1:]) == [2] * 10
    assert np.array_equal(pattern.colour, glove_pattern(skin).colour)
    for patch in range(1, 21):
        assert pieces(skin.triangles[pattern.patch == patch]) == 1
    assert pattern.same_colour_mm > glove_pattern(skin, draws=1).same_colour_mm
    with pytest.raises(BadInput, match="expected 1 <= colours"):
        glove_pattern(skin, patches=3, colours=4)


def pieces(triangles: np.ndarray) -> int:
    """Connected parts, by merging corners."""
    root = {int(corner): int(corner) for corner in triangles.ravel()}

    def top(corner: int) -> int:
        while root[corner] != corner:
            corner = root[corner]
        return corner

    for a, b, c in triangles.tolist():
        root[top(b)] = top(a)
        root[top(c)] = top(a)
    return len({top(corner) for corner in root})
