"""A hand on other skeletons: straight is straight, bends are the hand's, left is left, a pinch stays one."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parent))

from rigs import CONVENTIONS, TO_WORLD, angles_of, rig_like

from glovecal_models.errors import BadInput
from glovecal_models.hand.bones import HAND, PHALANGES, HandBones
from glovecal_models.hand.retargeting.retarget import Retargeting
from glovecal_models.hand.retargeting.rig import Rig, hand_of
from glovecal_models.hand.retargeting.touches import FAR_MM, Touches
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG, HANDS
from glovecal_models.hand.skeleton import hand_skeleton

each_rig = pytest.mark.parametrize("convention", CONVENTIONS)
each_hand = pytest.mark.parametrize("hand", HANDS)
AGREES_DEG = 1e-4


def made(convention: str, hand, **rest) -> Retargeting:
    return Retargeting.of(hand_skeleton(hand=hand), rig_like(CONVENTIONS[convention], hand, **rest))


def random_angles(count: int = 40, seed: int = 2) -> np.ndarray:
    low, high = np.array([ACTIVE_RANGE_DEG[name] for name in hand_skeleton().rotations]).T
    return np.random.default_rng(seed).uniform(low, high, (count, len(low)))


def directions(retargeting: Retargeting, orientations: np.ndarray) -> dict[str, np.ndarray]:
    """(N, 3) along each bone of the rig, in its world: from its head to the next one's as the rest pose has
    them, turned with the bone."""
    found = {}
    names = [retargeting.bones.names[segment] for segment in retargeting.segments]
    for number, own in enumerate(names):
        finger, _, part = own.partition("_")
        if own == HAND or part == "distal":
            continue
        parts = PHALANGES[finger]
        after = names.index(f"{finger}_{parts[parts.index(part) + 1]}")
        bone, following = (retargeting.rig.by_name[retargeting.names[at]] for at in (number, after))
        along = bone.orientation.T @ np.subtract(following.head, bone.head)
        found[own] = orientations[:, number] @ (along / np.linalg.norm(along))
    return found


def degrees_between(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    cross = np.linalg.norm(np.cross(first, second), axis=-1)
    return np.degrees(np.arctan2(cross, (first * second).sum(axis=-1)))


@each_rig
@each_hand
def test_every_bone_points_where_the_hand_points(convention: str, hand) -> None:
    retargeting = made(convention, hand)
    angles = random_angles()
    own = retargeting.bones.orientations(angles)
    for name, along in directions(retargeting, retargeting.orientations(angles)).items():
        wanted = own[:, retargeting.bones.names.index(name), :, 0] @ TO_WORLD[hand].T
        assert degrees_between(along, wanted).max() < AGREES_DEG, name


@each_rig
@each_hand
def test_a_straight_hand_is_straight_and_a_fist_is_a_fist(convention: str, hand) -> None:
    retargeting = made(convention, hand)
    straight = angles_of(retargeting.bones, {})
    fist = angles_of(retargeting.bones, {"MCP": 85.0, "PIP": 100.0, "DIP": 65.0})
    found = directions(retargeting, retargeting.orientations(np.concatenate([straight, fist])))
    fingers, back = TO_WORLD[hand][:, 0], TO_WORLD[hand][:, 2]
    for finger in ("index", "middle", "ring", "pinky"):
        for part in ("proximal", "intermediate"):
            assert degrees_between(found[f"{finger}_{part}"][0], fingers) < AGREES_DEG
        assert found[f"{finger}_intermediate"][1] @ fingers < -0.9, "the middle bones point back to the wrist"
        assert found[f"{finger}_proximal"][1] @ back < -0.9, "the first ones out of the palm"


@each_rig
@each_hand
def test_a_hand_in_the_rigs_rest_pose_leaves_every_bone_as_it_is(convention: str, hand) -> None:
    retargeting = made(convention, hand)
    angles = angles_of(retargeting.bones, CONVENTIONS[convention].at_rest_deg)
    turns = retargeting.from_rest(retargeting.against_parents(retargeting.orientations(angles)))
    seen = CONVENTIONS[convention].has_tips or CONVENTIONS[convention].axes is not None
    away = np.degrees(Rotation.from_matrix(turns[0]).magnitude())
    away = away if seen else away[[not name.endswith(("3", "Distal")) for name in retargeting.names]]
    assert away.max() < 1.0, "the thumb's rest pose is looked for in steps of a degree"


@each_rig
@each_hand
def test_a_joint_bends_as_far_as_the_hand_and_about_the_axis_that_is_known(convention: str, hand) -> None:
    retargeting = made(convention, hand)
    names = list(retargeting.bones.skeleton.rotations)
    straight = np.zeros((1, len(names)))
    bent = straight.copy()
    bent[0, names.index("I_PIP")] = 40.0
    straight_turns, bent_turns = (
        retargeting.from_rest(retargeting.against_parents(retargeting.orientations(one)))[0]
        for one in (straight, bent)
    )
    at = retargeting.names.index(hand_of(retargeting.rig, hand)["index_intermediate"])
    about = Rotation.from_matrix(straight_turns[at].T @ bent_turns[at]).as_rotvec(degrees=True)
    if CONVENTIONS[convention].axes is None and CONVENTIONS[convention].at_rest_deg.get("MCP"):
        assert np.linalg.norm(about) == pytest.approx(40.0, abs=AGREES_DEG), (
            "its axes are not the finger's at rest"
        )
    else:
        np.testing.assert_allclose(about, 40.0 * CONVENTIONS[convention].bends_about[hand], atol=1e-6)


@each_rig
@each_hand
def test_the_arm_does_not_matter_to_the_fingers(convention: str, hand) -> None:
    """A body's own motion turns the arm; fingers hang on the hand, whatever the rest pose of the arm."""
    angles = random_angles(5)
    level, hanging = made(convention, hand), made(convention, hand, swing_deg=60.0)
    turns = [each.from_rest(each.against_parents(each.orientations(angles))) for each in (level, hanging)]
    fingers = [number for number, segment in enumerate(level.segments) if level.bones.names[segment] != HAND]
    if CONVENTIONS[convention].axes is not None:
        np.testing.assert_allclose(turns[0][:, fingers], turns[1][:, fingers], atol=1e-9)


@each_rig
def test_the_left_hand_mirrors_the_right(convention: str) -> None:
    angles = random_angles()
    right, left = (made(convention, hand) for hand in ("right", "left"))
    found = [directions(each, each.orientations(angles)) for each in (right, left)]
    for name, along in found[0].items():
        np.testing.assert_allclose(found[1][name], along * [-1, 1, 1], atol=1e-9, err_msg=name)


@each_rig
@each_hand
def test_turns_against_parents_add_up_to_the_orientations(convention: str, hand) -> None:
    retargeting = made(convention, hand)
    orientations = retargeting.orientations(random_angles(4))
    local = retargeting.from_rest(retargeting.against_parents(orientations))
    world: dict[str, np.ndarray] = {}
    for bone in retargeting.rig.bones:
        parent = retargeting.rig.by_name.get(bone.parent or "")
        rest = bone.orientation if parent is None else parent.orientation.T @ bone.orientation
        above = np.tile(np.eye(3), (4, 1, 1)) if parent is None else world[parent.name]
        own = local[:, retargeting.names.index(bone.name)] if bone.name in retargeting.names else np.eye(3)
        world[bone.name] = above @ rest @ own
    for number, name in enumerate(retargeting.names):
        np.testing.assert_allclose(world[name], orientations[:, number], atol=1e-9)


@cache
def pinches(hand, count: int = 6) -> np.ndarray:
    """(count, R) angles of hands whose thumb meets the index finger, out of many made at random."""
    angles = random_angles(30_000, seed=5)
    bones = HandBones.of(hand_skeleton(hand=hand))
    tips = bones.posed(angles)[1][:, :, 1]
    gap = tips[:, bones.names.index("index_distal")] - tips[:, bones.names.index("thumb_distal")]
    return angles[np.argsort(np.linalg.norm(gap, axis=1))[:count]]


def tips_of(touches: Touches, joints: np.ndarray) -> dict[str, np.ndarray]:
    """(N, 3) by finger, from the wrist."""
    return {finger: joints[:, number, -1] for number, finger in enumerate(touches.chains)}


@each_rig
@each_hand
def test_a_pinch_stays_a_pinch_where_lengths_differ(convention: str, hand) -> None:
    retargeting = made(convention, hand)
    touches = Touches(retargeting)
    angles = pinches(hand)
    plain = retargeting.orientations(angles)
    kept = touches.orientations(angles)
    own = tips_of(touches, touches.own_joints_mm(angles))
    wanted = own["index"] - own["thumb"]

    def wrong_mm(orientations: np.ndarray) -> np.ndarray:
        tips = tips_of(touches, touches.joints(orientations))
        return np.linalg.norm(1 / touches.units_a_mm * (tips["index"] - tips["thumb"]) - wanted, axis=1)

    assert wrong_mm(kept).max() < 1.0
    assert wrong_mm(plain).max() > 5.0, "without it these lengths lose the touch"


def test_a_hand_that_touches_nothing_is_left_as_it_is_and_nothing_jumps() -> None:
    retargeting = made("rigify", "right")
    touches = Touches(retargeting)
    names = list(retargeting.bones.skeleton.rotations)
    flat = angles_of(retargeting.bones, {"TI_ABD": 50.0})
    plain = retargeting.orientations(flat)
    np.testing.assert_array_equal(touches.orientations(flat), plain)
    closing = flat + np.linspace(0, 1, 400)[:, None] * (pinches("right", 1) - flat)
    turned = touches.orientations(closing)
    steps = Rotation.from_matrix((turned[:-1].swapaxes(-1, -2) @ turned[1:]).reshape(-1, 3, 3)).magnitude()
    assert np.degrees(steps.max()) < 3.0
    own = tips_of(touches, touches.own_joints_mm(closing))
    distance = np.linalg.norm(own["index"] - own["thumb"], axis=1)
    assert distance[0] > FAR_MM > distance[-1]
    assert len(names) == closing.shape[1]


def test_bones_are_found_by_their_names() -> None:
    for convention in CONVENTIONS.values():
        for hand in HANDS:
            rig = rig_like(convention, hand)
            mapping = hand_of(rig, hand)
            assert mapping[HAND] == convention.hand(hand)
            for finger, parts in PHALANGES.items():
                for number, part in enumerate(parts, 1):
                    assert mapping[f"{finger}_{part}"] == convention.name(hand, finger, part, number)
            with pytest.raises(BadInput, match="hand was found among"):
                hand_of(rig, "left" if hand == "right" else "right")


def test_numbers_from_the_metacarpal_on_and_fingertips_are_not_mistaken() -> None:
    """Some rigs call the metacarpal 1, and the knuckle 2; some have a fourth bone that is the fingertip."""
    rig = rig_like(CONVENTIONS["unreal"], "left")
    renamed = {
        "index_metacarpal_l": "index_01_l",
        **{f"index_0{n}_l": f"index_0{n + 1}_l" for n in (1, 2, 3)},
    }
    bones = tuple(
        replace(
            bone, name=renamed.get(bone.name, bone.name), parent=renamed.get(bone.parent or "", bone.parent)
        )
        for bone in rig.bones
    )
    assert hand_of(Rig(bones), "left")["index_proximal"] == "index_02_l"
    mixamo = rig_like(CONVENTIONS["mixamo"], "left")
    last = mixamo.by_name["mixamorig:LeftHandIndex3"]
    tip = replace(last, name="mixamorig:LeftHandIndex4", parent=last.name, head=last.tail, tail=None)
    with_tip = Rig((*(replace(bone, tail=None) for bone in mixamo.bones), tip))
    assert hand_of(with_tip, "left")["index_proximal"] == "mixamorig:LeftHandIndex1"
    assert with_tip.end(last.name) == pytest.approx(np.array(last.tail))


def test_what_cannot_be_mapped_is_said() -> None:
    rig = rig_like(CONVENTIONS["rigify"], "right")
    mapping = hand_of(rig, "right")
    with pytest.raises(BadInput, match="no bone 'nose', which is to be index_distal"):
        Retargeting.of(hand_skeleton(), rig, mapping | {"index_distal": "nose"})
    with pytest.raises(BadInput, match="a hand has no bone 'toe'"):
        Retargeting.of(hand_skeleton(), rig, mapping | {"toe": "hand.R"})
    flat = Rig(tuple(replace(bone, head=(0.0, 0.0, 0.0)) for bone in rig.bones))
    with pytest.raises(BadInput, match="no direction from the wrist"):
        Retargeting.of(hand_skeleton(), flat, mapping)


@pytest.mark.parametrize(
    ("first", "pattern"),
    [
        (1, "{side}Finger{number}{part}"),
        (0, "Bip01 {letter} Finger{number}{place}"),
        (1, "{letter}_digit_{number}_{part}"),
    ],
)  # fmt: skip
@each_hand
def test_fingers_that_are_numbered_are_counted_from_the_thumb(hand, first: int, pattern: str) -> None:
    """As in Rokoko's character and in 3ds Max's Biped."""
    rig = rig_like(CONVENTIONS["unreal"], hand)
    named = hand_of(rig, hand)
    new = {named[HAND]: f"{hand.capitalize()}Hand"}
    for number, (finger, parts) in enumerate(PHALANGES.items(), first):
        for place, part in enumerate(parts):
            new[named[f"{finger}_{part}"]] = pattern.format(
                side=hand.capitalize(), letter=hand[0].upper(), number=number, part=part, place=place or ""
            )
    bones = tuple(
        replace(bone, name=new.get(bone.name, bone.name), parent=new.get(bone.parent or "", bone.parent))
        for bone in rig.bones
        if "metacarpal" not in bone.name
    )
    bones = tuple(
        bone if bone.parent is None or any(bone.parent == each.name for each in bones)
        else replace(bone, parent=f"{hand.capitalize()}Hand")
        for bone in bones
    )  # fmt: skip
    assert hand_of(Rig(bones), hand) == {own: new[name] for own, name in named.items()}
