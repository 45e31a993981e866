"""The example: hands in MuJoCo that follow a glove, recorded as a data set that pyarrow reads back."""

# pyright: reportAttributeAccessIssue=false, reportMissingImports=false

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import mujoco_hand
import numpy as np
import pytest
from lerobot_teleoperator_glovecal.joint_actions import GloveNotUsable, JointAction
from lerobot_teleoperator_glovecal.robot_joints import RobotJoints
from loopback import free_endpoint
from published_poses import HOLD_S, NAMES, POSE, Glove
from pyarrow import parquet

from glovecal_client import open_router
from glovecal_client.wire.pose import RotationFlag
from glovecal_models.hand.retargeting.robot import RobotHand, urdf_of
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG, HAND_ROTATIONS
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_service.exports.robot_hand import mjcf
from lerobot_teleoperator_glovecal import GlovecalTeleoperator, GlovecalTeleoperatorConfig

TRYING = ("--allow-simulated", "--hold", f"{HOLD_S:g}")
GRIPPER = """
<mujoco>
  <compiler angle="radian"/>
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="palm">
      <inertial pos="0 0 0" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/>
      <joint name="wrist" axis="0 0 1" range="-0.5 0.5" limited="true" armature="0.001" damping="0.05"/>
      <body name="finger" pos="0.1 0 0">
        <inertial pos="0 0 0" mass="0.02" diaginertia="1e-5 1e-5 1e-5"/>
        <joint name="knuckle" axis="0 1 0" armature="0.001" damping="0.05"/>
      </body>
    </body>
  </worldbody>
  <actuator><position name="grip" joint="knuckle" kp="1"/></actuator>
</mujoco>
"""


@contextmanager
def published(**options) -> Iterator[tuple[Glove, str]]:
    endpoint = free_endpoint()
    with open_router([endpoint]):
        glove = Glove(endpoint, **options)
        try:
            yield glove, endpoint
        finally:
            glove.close()


def rows_of(folder: Path) -> dict[str, np.ndarray]:
    table = parquet.read_table(folder / "data/chunk-000/file-000.parquet")
    return {name: np.array(table[name].to_pylist()) for name in table.column_names}


def test_the_subjects_own_hand_follows_every_rotation(tmp_path: Path) -> None:
    model, folder = tmp_path / "hand.xml", tmp_path / "dataset"
    model.write_text(mjcf(hand_skeleton(None, "right")), encoding="utf-8")
    low, high = np.array([ACTIVE_RANGE_DEG[name] for name in HAND_ROTATIONS]).T
    degrees = low + np.random.default_rng(2).uniform(0.2, 0.8, len(low)) * (high - low)
    many = np.zeros(len(low))
    pose = replace(
        POSE, degrees=degrees.astype(np.float32), deviations=(many + 1).astype(np.float32),
        rotation_flags=many.astype(np.uint8),
    )  # fmt: skip
    with published(pose=pose, names=HAND_ROTATIONS) as (_, endpoint):
        words = [str(model), str(folder), "--connect", endpoint, "--seconds", "3", *TRYING]
        assert mujoco_hand.main(words) == 0
    info = json.loads((folder / "meta/info.json").read_text(encoding="utf-8"))
    names = [name.removesuffix(".pos") for name in info["features"]["action"]["names"]]
    assert sorted(names) == sorted(HAND_ROTATIONS)
    assert (info["fps"], info["total_frames"], info["robot_type"]) == (30, 90, "hand")
    rows, order = rows_of(folder), [HAND_ROTATIONS.index(name) for name in names]
    assert np.abs(rows["action"][0]).max() < 0.1, "it begins where the hand is straight"
    np.testing.assert_allclose(np.degrees(rows["action"][-1]), degrees[order], atol=1e-3)
    np.testing.assert_allclose(np.degrees(rows["observation.state"][-1]), degrees[order], atol=1.5)
    assert rows["frame_index"].tolist() == list(range(90))


def test_another_hand_is_mapped_and_a_faulty_sensor_ends_the_recording(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    model, folder, mapped = tmp_path / "gripper.xml", tmp_path / "dataset", tmp_path / "map.json"
    model.write_text(GRIPPER, encoding="utf-8")
    actions = {
        "grip.pos": {"gains": {"I_PIP": 0.01, "M_PIP": 0.005}, "low": 0.0, "high": 0.6},
        "wrist.pos": {"gains": {"I_MCP": 0.01}},
    }
    mapped.write_text(json.dumps(actions), encoding="utf-8")
    told = mujoco_hand.MujocoHand.send_action
    with published() as (glove, endpoint):

        def tell(hand: mujoco_hand.MujocoHand, action: dict[str, float], seconds: float) -> None:
            told(hand, action, seconds)
            if action["grip.pos"] > 0.599 and glove.pose is not None:
                flags = np.zeros(3, np.uint8)
                flags[NAMES.index("I_PIP")] = RotationFlag.FAULTY_SENSOR
                glove.pose = replace(glove.pose, rotation_flags=flags)

        monkeypatch.setattr(mujoco_hand.MujocoHand, "send_action", tell)
        words = [str(model), str(folder), "--map", str(mapped), "--connect", endpoint]
        assert mujoco_hand.main([*words, "--seconds", "60", *TRYING]) == 1
    why = (
        f"It ended early: glove right stopped moving the robot after {HOLD_S:g} s: a sensor of rotation I_PIP"
    )
    assert why in capsys.readouterr().err
    rows = rows_of(folder)
    np.testing.assert_allclose(rows["action"][-1], [0.6, 0.3], atol=2e-3)
    np.testing.assert_allclose(rows["observation.state"][-1], [0.6, 0.3], atol=0.02)
    assert len(rows["index"]) < 1800


def test_a_robots_hand_does_what_the_persons_does(tmp_path: Path) -> None:
    compiler = '<mujoco><compiler boundmass="0.01" boundinertia="1e-5" fusestatic="false"/></mujoco></robot>'
    spec = mujoco.MjSpec.from_string(urdf_of("allegro_right").replace("</robot>", compiler))
    for joint in spec.joints:
        joint.armature = 1e-3
    model, folder = tmp_path / "allegro.xml", tmp_path / "dataset"
    spec.compile()
    model.write_text(spec.to_xml(), encoding="utf-8")
    fist = {name: 80.0 for name in HAND_ROTATIONS if name.partition("_")[2] in ("MCP", "PIP", "DIP")}
    degrees = np.array([fist.get(name, 10.0) for name in HAND_ROTATIONS], np.float32)
    many = np.zeros(len(degrees))
    pose = replace(
        POSE, degrees=degrees, deviations=(many + 1).astype(np.float32), rotation_flags=many.astype(np.uint8)
    )
    with published(pose=pose, names=HAND_ROTATIONS) as (_, endpoint):
        words = [str(model), str(folder), "--robot", "allegro", "--connect", endpoint, "--seconds", "3"]
        assert mujoco_hand.main([*words, *TRYING]) == 0
    names = json.loads((folder / "meta/info.json").read_text(encoding="utf-8"))["features"]["action"]["names"]
    rows, robot = rows_of(folder), RobotHand.known("allegro_right")
    assert [name.removesuffix(".pos") for name in names] == list(robot.free)
    assert (rows["action"] >= robot.limits[:, 0] - 1e-6).all()
    assert (rows["action"] <= robot.limits[:, 1] + 1e-6).all()
    last = dict(zip(robot.free, rows["action"][-1], strict=True))
    for finger in ("ff", "mf", "rf"):
        np.testing.assert_allclose(
            np.degrees([last[f"{finger}j{number}"] for number in (1, 2, 3)]), 80.0, atol=8.0
        )
    np.testing.assert_allclose(rows["observation.state"][-1], rows["action"][-1], atol=0.05)


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ({"robot": "alegro"}, "did you mean 'allegro'"),
        ({"robot": "leap", "side": "left"}, "leap_right"),
        ({"robot": "shadow", "unit": "turns"}, "radians or degrees"),
        ({"robot": "shadow", "actions": {"a": JointAction({"I_PIP": 1.0})}}, "give one of them"),
        ({}, "name each action"),
    ],
)
def test_robots_that_cannot_be_are_refused_before_anything_moves(asked: dict[str, Any], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        GlovecalTeleoperator(GlovecalTeleoperatorConfig(**asked))


def test_the_other_hands_glove_moves_no_robot() -> None:
    mapping = RobotJoints("shadow", "right", "degrees")
    with pytest.raises(GloveNotUsable, match="on the left hand"):
        mapping.know({"hand": "left", "rotations": list(HAND_ROTATIONS)})
    mapping.know({"hand": "right", "rotations": ["I_PIP", "W_FLEX"], "skeleton": None})
    assert mapping.rotations == {"I_PIP", "W_FLEX"}
    bent = mapping.values({"I_PIP": 70.0, "W_FLEX": 0.0})
    assert bent["rh_FFJ2.pos"] == pytest.approx(70.0, abs=1.0)


def test_joints_that_are_not_there_and_folders_that_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = tmp_path / "gripper.xml"
    model.write_text(GRIPPER, encoding="utf-8")
    with pytest.raises(ValueError, match=r"has no joint or actuator thumb; it has wrist, knuckle"):
        mujoco_hand.MujocoHand(model, ["thumb.pos"])
    with pytest.raises(SystemExit):
        mujoco_hand.main([str(model), str(tmp_path)])
    assert "is there already; name another folder" in capsys.readouterr().err
