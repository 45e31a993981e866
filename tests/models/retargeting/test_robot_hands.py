"""A hand on robots: a straight finger is straight, a fist is a fist, a pinch a pinch, within every limit."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parent))

from rigs import angles_of

from glovecal_models.errors import BadInput
from glovecal_models.hand.bones import HandBones
from glovecal_models.hand.retargeting.robot import RobotHand, known_robots, urdf_of
from glovecal_models.hand.retargeting.robot_retarget import RobotRetargeting
from glovecal_models.hand.retargeting.touches import TOUCHING_MM
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG, known_hand
from glovecal_models.hand.skeleton import hand_skeleton

each_robot = pytest.mark.parametrize("name", known_robots())
FIST = {"MCP": 85.0, "PIP": 95.0, "DIP": 65.0}


@cache
def onto(name: str) -> RobotRetargeting:
    hand = known_hand(name.rpartition("_")[2])
    assert hand is not None
    return RobotRetargeting(hand_skeleton(hand=hand), RobotHand.known(name))


def random_angles(count: int, seed: int = 2) -> np.ndarray:
    low, high = np.array([ACTIVE_RANGE_DEG[name] for name in hand_skeleton().rotations]).T
    return np.random.default_rng(seed).uniform(low, high, (count, len(low)))


def along(joints: np.ndarray) -> np.ndarray:
    """(N, F, K, 3) of bones, of ``joints`` (N, F, K + 1, 3)."""
    steps = np.diff(joints, axis=2)
    return steps / np.linalg.norm(steps, axis=3, keepdims=True)


def gaps(joints: np.ndarray) -> np.ndarray:
    return np.linalg.norm(joints[:, 1:, -1] - joints[:, :1, -1], axis=2)


@each_robot
def test_its_kinematics_are_those_that_mujoco_reads(name: str) -> None:
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed; uv sync installs it")
    compiler = '<mujoco><compiler boundmass="0.01" boundinertia="1e-5" fusestatic="false"/></mujoco></robot>'
    model = mujoco.MjModel.from_xml_string(urdf_of(name).replace("</robot>", compiler))
    data = mujoco.MjData(model)
    robot = RobotHand.known(name)
    low, high = robot.limits.T
    angles = np.random.default_rng(4).uniform(low, high, (5, len(robot.free)))
    orientations, places = robot.posed(angles)
    for frame, values in enumerate(angles):
        for joint, value in zip(robot.free, values, strict=True):
            data.joint(joint).qpos = value
        mujoco.mj_forward(model, data)
        for point, (hinge, place, turn) in robot.points.items():
            body = data.body(point)
            at, axes = place, turn
            if hinge is not None:
                at = places[frame, hinge] + orientations[frame, hinge] @ place
                axes = orientations[frame, hinge] @ turn
            np.testing.assert_allclose(1e3 * body.xpos, at, atol=1e-6, err_msg=f"{name} {point}")
            np.testing.assert_allclose(body.xmat.reshape(3, 3), axes, atol=1e-9, err_msg=f"{name} {point}")
    limits = {joint: model.joint(joint).range for joint in robot.free}
    np.testing.assert_allclose(robot.limits, [limits[joint] for joint in robot.free], atol=1e-12)


@each_robot
def test_a_straight_hand_is_straight_and_a_fist_is_a_fist(name: str) -> None:
    made = onto(name)
    bones = HandBones.of(made.skeleton)
    poses = np.concatenate([angles_of(bones, {}), angles_of(bones, FIST)])
    shown = along(made.joints(made.radians(poses)))[:, 1:]
    assert (shown[0, :, :, 0] > np.cos(np.radians(6.0))).all(), (
        "Allegro's outer fingers stand 5 degrees askew"
    )
    assert (shown[1, :, 0, 2] < -0.9).all(), "the first bones point out of the palm"
    assert (shown[1, :, 1, 0] < -0.9).all(), "the middle bones point back to the wrist"
    assert (shown[1, :, 2, 2] > 0.5).all(), "the last ones towards the palm"


@each_robot
def test_bones_point_where_the_hands_point_as_far_as_limits_let_them(name: str) -> None:
    made = onto(name)
    names = list(made.skeleton.rotations)
    angles = np.zeros((50, len(names)))
    for letter in "IMRP":
        for joint, most in (("MCP", 80.0), ("PIP", 85.0), ("DIP", 60.0)):
            angles[:, names.index(f"{letter}_{joint}")] = np.random.default_rng(7).uniform(0, most, 50)
    away = np.degrees(np.arccos(np.clip(_agreement(made, angles)[:, 1:], -1, 1)))
    assert np.median(away) < 2.0
    assert away.max() < 10.0


def _agreement(made: RobotRetargeting, angles: np.ndarray) -> np.ndarray:
    own = along(made.own_joints_mm(angles))
    return (own * along(made.joints(made.radians(angles)))).sum(axis=3)


@each_robot
def test_no_joint_leaves_its_limits(name: str) -> None:
    made = onto(name)
    angles = made.radians(random_angles(200))
    low, high = made.robot.limits.T
    assert (angles >= low).all()
    assert (angles <= high).all()


@each_robot
def test_most_touches_stay_touches(name: str) -> None:
    made = onto(name)
    drawn = random_angles(20_000, seed=5)
    own = gaps(made.own_joints_mm(drawn))
    near = np.argsort(own[:, 0])[:40]  # thumb and index finger
    shown = gaps(made.joints(made.radians(drawn[near])))
    assert (own[near, 0] < TOUCHING_MM).all()
    assert np.median(shown[:, 0] - own[near, 0]) < 3.0
    assert (shown[:, 0] < own[near, 0] + 10.0).mean() > 0.85


def test_the_left_hand_mirrors_the_right() -> None:
    angles = random_angles(30)
    for kind, turned in (("shadow", ()), ("allegro", ("ffj0", "mfj0", "rfj0"))):
        right, left = onto(f"{kind}_right"), onto(f"{kind}_left")
        shown = [made.radians(angles) for made in (right, left)]
        names = [joint.removeprefix("lh_") for joint in left.robot.free]
        own = {
            joint.removeprefix("rh_"): column
            for joint, column in zip(right.robot.free, shown[0].T, strict=True)
        }
        for joint, column in zip(names, shown[1].T, strict=True):
            sign = -1.0 if joint in turned else 1.0
            np.testing.assert_allclose(column, sign * own[joint], atol=5e-3, err_msg=f"{kind} {joint}")


@each_robot
def test_a_hand_that_moves_little_moves_the_robot_little(name: str) -> None:
    """Live poses begin where the one before ended, an export begins anew: both end in the same."""
    made = onto(name)
    begin, end = random_angles(2, seed=9)
    path = begin + np.linspace(0.0, 1.0, 200)[:, None] * (end - begin)
    anew = made.radians(path)
    assert np.degrees(np.abs(np.diff(anew, axis=0))).max() < 6.0
    before = anew[0]
    for pose, wanted in zip(path, anew, strict=True):
        before = made.radians(pose[None], before)[0]
        assert np.degrees(np.abs(before - wanted)).max() < 3.0


MIMICKING = """<robot name="claw">
  <link name="palm"/><link name="a"/><link name="b"/>
  <joint name="one" type="revolute"><parent link="palm"/><child link="a"/><axis xyz="0 0 2"/>
    <limit lower="-1" upper="1"/></joint>
  <joint name="two" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0.1 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1"/><mimic joint="one" multiplier="-2" offset="0.5"/></joint>
  FIXED
</robot>"""
FINGERS = [
    f"{finger}_{part}"
    for finger in ("index", "middle")
    for part in ("proximal", "intermediate", "distal", "tip")
]


def claw(fixed: str = "") -> str:
    links = "".join(
        f'<joint name="{name}_f" type="fixed"><parent link="b"/><child link="{name}"/></joint>'
        for name in ("hand", *FINGERS)
    )
    return MIMICKING.replace("FIXED", fixed or links)


def test_a_joint_that_mimics_follows_and_its_limits_count() -> None:
    robot = RobotHand.from_urdf(claw(), "claw")
    assert robot.free == ("one",)
    np.testing.assert_allclose(robot.limits, [[-0.25, 0.75]])
    orientations, places = robot.posed(np.array([[0.25]]))
    assert orientations[0, 1, 0, 0] == pytest.approx(np.cos(0.25)), "0.25 and then -2 x 0.25 + 0.5"
    np.testing.assert_allclose(places[0, 1], [100 * np.cos(0.25), 100 * np.sin(0.25), 0.0])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "no XML"),
        ("<mujoco/>", "describes no robot"),
        (claw('<joint name="c" type="fixed"/>'), "no parent link"),
        (claw('<joint name="c" type="prismatic"><parent link="b"/><child link="c"/></joint>'), "prismatic"),
        (claw('<joint name="c" type="fixed"><parent link="b"/><child link="a"/></joint>'), "hangs on two"),
        (claw('<joint name="c" type="fixed"><parent link="x"/><child link="c"/></joint>'), "hang on nothing"),
        (claw('<joint name="c" type="fixed"><parent link="b"/><child link="c"/></joint>'), "no hand"),
        (claw().replace('upper="1"', 'upper="nan"'), "no number"),
        (claw().replace('xyz="0.1 0 0"', 'xyz="0.1 0"'), "three numbers"),
        (claw().replace('xyz="0 0 2"', 'xyz="0 0 0"'), "no direction"),
        (claw().replace('multiplier="-2"', 'multiplier="0"'), "factor of 0"),
        (claw().replace('joint="one"', 'joint="two"'), "no joint of its own"),
    ],
)  # fmt: skip
def test_what_cannot_be_used_is_refused(text: str, says: str) -> None:
    with pytest.raises(BadInput, match=says):
        RobotHand.from_urdf(text, "claw.urdf")


def test_links_can_be_named_and_wrong_names_are_told() -> None:
    bare = urdf_of("shadow_right").replace('"index_tip"', '"fingertip"')
    links = {"index_tip": "fingertip"}
    assert "index" not in RobotHand.from_urdf(bare, "shadow").fingers
    assert "index" in RobotHand.from_urdf(bare, "shadow", links).fingers
    for wrong, says in (
        ({"index_tip": "fingertop"}, "did you mean"),
        ({"index_top": "fingertip"}, "did you mean"),
    ):
        with pytest.raises(BadInput, match=says):
            RobotHand.from_urdf(bare, "shadow", links | wrong)
    with pytest.raises(BadInput, match="shadow_right"):
        RobotHand.known("shadow_rigth")


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_damaged_descriptions_are_refused_by_a_sentence_or_read(data: st.DataObject) -> None:
    text = claw()
    begin = data.draw(st.integers(0, len(text) - 1))
    length = data.draw(st.integers(0, 30))
    damaged = text[:begin] + data.draw(st.text(max_size=10)) + text[begin + length :]
    try:
        robot = RobotHand.from_urdf(damaged, "claw")
    except BadInput:
        return
    orientations, places = robot.posed(np.zeros((1, len(robot.free))))
    assert np.isfinite(orientations).all()
    assert np.isfinite(places).all()
