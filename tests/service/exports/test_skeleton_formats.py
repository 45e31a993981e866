"""Formats with a skeleton hold against readers that nobody here wrote: places, times, sides, what is said.

The same files in Blender: ``python3 do.py blender --test``.
"""

from __future__ import annotations

import json
import struct
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pxr.Usd
import pxr.UsdGeom
import pxr.UsdSkel
import pxr.UsdValidation
import pybvh
import pygltflib
import pytest
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parent))

from posed_hands import AGREES_MM, RATE_HZ, Places, moving, worst_mm

from glovecal_models.hand.bones import HandBones
from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_service.exports.body_motion import END, BodyMotion, continuous_quaternions
from glovecal_service.exports.formats import FORMATS


def read_glb(path: Path, time_s: float) -> Places:
    """Metres; a node's matrix is its parent's times its own (glTF 2.0, section 3.5.2)."""
    document: Any = pygltflib.GLTF2.load_binary(str(path))
    blob = document.binary_blob()

    def numbers(index: int, width: int) -> np.ndarray:
        accessor = document.accessors[index]
        view = document.bufferViews[accessor.bufferView]
        begin = (view.byteOffset or 0) + (accessor.byteOffset or 0)
        return (
            np.frombuffer(blob, "<f4", accessor.count * width, begin)
            .reshape(accessor.count, width)
            .astype(float)
        )

    animation = document.animations[0]
    turned = {}
    for channel in animation.channels:
        assert channel.target.path == "rotation"
        sampler = animation.samplers[channel.sampler]
        times, values = numbers(sampler.input, 1)[:, 0], numbers(sampler.output, 4)
        frame = int(np.argmin(np.abs(times - time_s)))
        assert times[frame] == pytest.approx(time_s, abs=1e-6)
        turned[channel.target.node] = Rotation.from_quat(values[frame]).as_matrix()
    found: Places = {}

    def go(number: int, place: np.ndarray, axes: np.ndarray) -> None:
        node = document.nodes[number]
        place = place + axes @ np.array(node.translation or [0, 0, 0])
        rest = Rotation.from_quat(node.rotation or [0, 0, 0, 1]).as_matrix()
        axes = axes @ turned.get(number, rest)
        found[node.name] = 1000 * place
        for child in node.children or []:
            go(child, place, axes)

    go(document.scenes[0].nodes[0], np.zeros(3), np.eye(3))
    return found


UFBX = """
import json, os, sys, ufbx
scene = ufbx.load_file(sys.argv[1])
still = ufbx.evaluate_scene(scene, scene.anim, float(sys.argv[2]))
kept, places = [], {}
for bone in scene.nodes:
    if bone.name:
        node = still.find_node(bone.name)
        matrix = node.node_to_world
        place = matrix.c3
        kept += [bone, node, matrix, place]  # this version of the reader crashes where one of them is gone
        unit_mm = 1000 * scene.settings.unit_meters
        places[bone.name] = [unit_mm * place.x, unit_mm * place.y, unit_mm * place.z]
keys = [key.time for key in scene.anim_curves[0].keyframes]
print(json.dumps({"places": places, "keys": keys, "end": scene.anim_stacks[0].time_end}), flush=True)
os._exit(0)  # and where it ends
"""


def ufbx(path: Path, time_s: float) -> dict:
    pytest.importorskip("ufbx", reason="ufbx, an independent reader of FBX, has no package for this computer")
    done = subprocess.run(
        [sys.executable, "-I", "-c", UFBX, str(path), str(time_s)], capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout)


def read_fbx(path: Path, time_s: float) -> Places:
    return {name: np.array(place) for name, place in ufbx(path, time_s)["places"].items()}


def read_bvh(path: Path, time_s: float) -> Places:
    motion = pybvh.Bvh.from_file(path)
    frame = round(time_s / motion.frame_time)
    places = 10 * motion.node_positions(frame)
    names = [
        f"{node.parent.name}{END}" if node.parent and node.is_end_site() else node.name
        for node in motion.nodes
    ]
    return dict(zip(names, places, strict=True))


USD: Any = pxr  # no types


def read_usd(path: Path, time_s: float) -> Places:
    stage = USD.Usd.Stage.Open(str(path))
    skeleton = USD.UsdSkel.Cache().GetSkelQuery(USD.UsdSkel.Skeleton(stage.GetPrimAtPath("/Hands/Skeleton")))
    at = USD.Usd.TimeCode(time_s * stage.GetTimeCodesPerSecond())
    matrices = np.array(skeleton.ComputeJointSkelTransforms(at))
    unit_mm = 1000 * USD.UsdGeom.GetStageMetersPerUnit(stage)
    names = [str(joint).rpartition("/")[2] for joint in skeleton.GetJointOrder()]
    return dict(zip(names, unit_mm * matrices[:, 3, :3], strict=True))


READERS: dict[str, Callable[[Path, float], Places]] = {
    ".bvh": read_bvh, ".glb": read_glb, ".fbx": read_fbx, ".usda": read_usd,
}  # fmt: skip


def test_openusds_validators_have_nothing_to_say(tmp_path: Path) -> None:
    FORMATS[".usda"].write([moving("R"), moving("L")], "joints", tmp_path / "both.usda")
    validators = USD.UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 20
    stage = USD.Usd.Stage.Open(str(tmp_path / "both.usda"))
    complaints = USD.UsdValidation.ValidationContext(validators).Validate(stage)
    assert [complaint.GetMessage() for complaint in complaints] == []


@pytest.mark.parametrize("palm", ["rigid", "arching"])
@pytest.mark.parametrize("suffix", READERS)
def test_another_reader_finds_every_joint_and_fingertip_of_both_hands(tmp_path: Path, suffix, palm) -> None:
    hands, path = [moving("R", palm), moving("L", palm)], tmp_path / f"both{suffix}"
    FORMATS[suffix].write(hands, "joints", path)
    for frame in (0, 5, 11):
        places = READERS[suffix](path, frame / RATE_HZ)
        for hand in hands:
            assert worst_mm(places, hand, frame) < AGREES_MM, (hand.label, frame)


@pytest.mark.parametrize("suffix", READERS)
def test_the_check_fails_for_the_other_hand_another_frame_and_another_unit(tmp_path: Path, suffix) -> None:
    """What the test before would not see, it would not hold."""
    hand, path = moving("R"), tmp_path / f"one{suffix}"
    FORMATS[suffix].write([hand], "joints", path)
    places = READERS[suffix](path, 5 / RATE_HZ)
    assert worst_mm(places, hand, 6) > 1.0
    assert worst_mm({name: 1.01 * place for name, place in places.items()}, hand, 5) > 1.0
    other = {
        f"Right{name.removeprefix('Left')}": at for name, at in places.items() if name.startswith("Left")
    }
    assert worst_mm(other, hand, 5) > 1.0


@pytest.mark.parametrize("suffix", READERS)
def test_the_hand_that_was_not_recorded_is_at_rest(tmp_path: Path, suffix) -> None:
    path = tmp_path / f"one{suffix}"
    FORMATS[suffix].write([moving("R")], "joints", path)
    places = READERS[suffix](path, 0.0)
    straight = places[f"LeftHandMiddle3{END}"] - places["LeftHandMiddle1"]
    assert straight[0] == pytest.approx(np.linalg.norm(straight), abs=1e-3)
    assert places["RightHand"][0] < 0 < places["LeftHand"][0]


def test_frames_keep_their_own_times(tmp_path: Path) -> None:
    time_s = 100.0 + np.cumsum(np.where(np.arange(40) % 4, 0.0166, 0.0169))
    hand = replace(moving(count=40), time_s=time_s)
    for suffix in (".glb", ".fbx", ".usda"):
        FORMATS[suffix].write([hand], "joints", tmp_path / f"own{suffix}")
        for frame in (0, 17, 39):
            places = READERS[suffix](tmp_path / f"own{suffix}", float(time_s[frame] - time_s[0]))
            assert worst_mm(places, hand, frame) < AGREES_MM, (suffix, frame)
    told = ufbx(tmp_path / "own.fbx", 0.0)
    np.testing.assert_allclose(told["keys"], time_s - time_s[0], atol=1e-10)
    assert told["end"] == pytest.approx(time_s[-1] - time_s[0], abs=1e-10)


def test_between_frames_no_bone_turns_the_long_way_round(tmp_path: Path) -> None:
    hand = moving(count=200)
    degrees = np.tile(np.linspace(-400.0, 400.0, 200)[:, None], (1, len(hand.rotations)))
    turning = replace(hand, degrees=degrees)
    body = BodyMotion.of([turning], "joints", ".glb")
    steps = [quaternions for _, quaternions in continuous_quaternions(body.turns())]
    assert (np.einsum("nbi,nbi->nb", steps[0][1:], steps[0][:-1]) > 0).all()
    FORMATS[".fbx"].write([turning], "joints", tmp_path / "turning.fbx")
    fine = replace(turning, degrees=(degrees[:-1] + degrees[1:]) / 2)
    for frame in (20, 99, 150):
        places = read_fbx(tmp_path / "turning.fbx", (frame + 0.5) / RATE_HZ)
        assert worst_mm(places, fine, frame) < 1.0


@pytest.mark.parametrize("suffix", READERS)
def test_what_was_written_in_blocks_is_what_was_written_at_once(tmp_path: Path, suffix, monkeypatch) -> None:
    hands = [moving("R", count=50), moving("L", count=50)]
    for name, frames in (("whole", 4096), ("parts", 7)):
        monkeypatch.setattr("glovecal_service.exports.hand_motion.FRAMES_AT_ONCE", frames)
        FORMATS[suffix].write(hands, "joints", tmp_path / f"{name}{suffix}")
    assert (tmp_path / f"whole{suffix}").read_bytes() == (tmp_path / f"parts{suffix}").read_bytes()


@pytest.mark.parametrize("suffix", [".glb", ".fbx", ".usda"])
def test_what_it_was_made_of_is_said_in_the_file(tmp_path: Path, suffix: str) -> None:
    FORMATS[suffix].write([replace(moving(), simulated=True)], "joints", tmp_path / f"made{suffix}")
    content = (tmp_path / f"made{suffix}").read_bytes()
    assert b"wave" in content
    assert b"SimulatedGlove" in content
    FORMATS[suffix].write([moving()], "joints", tmp_path / f"real{suffix}")
    assert b"SimulatedGlove" not in (tmp_path / f"real{suffix}").read_bytes()


@pytest.mark.parametrize("suffix", READERS)
def test_one_frame_is_one_frame(tmp_path: Path, suffix: str) -> None:
    if suffix != ".bvh":
        FORMATS[suffix].write([moving(count=1)], "joints", tmp_path / f"one{suffix}")
        assert worst_mm(READERS[suffix](tmp_path / f"one{suffix}", 0.0), moving(count=1), 0) < AGREES_MM


def test_a_glb_says_how_long_it_is(tmp_path: Path) -> None:
    path = tmp_path / "one.glb"
    FORMATS[".glb"].write([moving()], "joints", path)
    magic, version, length = struct.unpack("<4sII", path.read_bytes()[:12])
    assert (magic, version, length) == (b"glTF", 2, path.stat().st_size)


def test_bones_are_those_of_the_kinematics() -> None:
    hand = moving("L", "arching")
    bones = HandBones.of(hand.skeleton)
    frames = forward_kinematics(hand.skeleton, hand.degrees)
    own = bones.orientations(hand.degrees)
    names = [joint.name for joint in hand.skeleton.joints]
    for bone, joint in (
        ("index_distal", "I_DIP"),
        ("thumb_metacarpal", "T_VIR"),
        ("pinky_metacarpal", "P_CMC"),
    ):
        at = bones.names.index(bone)
        np.testing.assert_array_equal(own[:, at], frames.orientations[:, names.index(joint)])
    last = bones.names.index("middle_distal")
    tip = frames.joints_mm[:, names.index("M_DIP")] + own[:, last] @ bones.tails_mm[last]
    np.testing.assert_allclose(tip, frames.tips_mm[:, 2], atol=1e-9)
