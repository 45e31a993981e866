"""Standard deviations and flags travel with the angles, and readers that nobody here wrote find them."""

from __future__ import annotations

import json
import subprocess
import sys
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import c3d
import numpy as np
import pxr.Usd
import pygltflib
import pytest
from mcap.reader import make_reader
from rosbags.typesys import Stores, get_typestore

sys.path.insert(0, str(Path(__file__).parent))

from characters import write_character, write_fbx_character
from posed_hands import RATE_HZ, moving

from glovecal_service.exports.character_files import read_character
from glovecal_service.exports.formats import FORMATS
from glovecal_service.exports.hand_motion import NOT_KNOWN, HandMotion

UNCERTAIN_AT, FLAGGED = 4, slice(5, 8)
Read = dict[str, np.ndarray]
"""(N, R) by channel, of the right hand, in the order of its rotations."""


def doubtful() -> HandMotion:
    """A deviation that changes and is once not known; flags that come and go."""
    motion = moving()
    sd_deg = np.linspace(1.0, 2.0, motion.degrees.size).reshape(motion.degrees.shape)
    sd_deg[UNCERTAIN_AT, 2] = np.nan
    flags = np.zeros(sd_deg.shape, np.uint8)
    flags[FLAGGED, 3] = 2
    flags[6, 3] = 10
    return replace(motion, sd_deg=sd_deg, flags=flags)


UFBX = """
import json, os, sys, ufbx
scene, rotations, rows = ufbx.load_file(sys.argv[1]), sys.argv[3].split(), []
stacks = scene.anim_stacks
stack = stacks[len(stacks) - 1]
anim = stack.anim
for frame in range(int(sys.argv[2])):
    still = ufbx.evaluate_scene(scene, anim, (frame + 0.001) / 60)
    hand = still.find_node(sys.argv[4])
    own = hand.props
    rows.append([[own.find_real(f"{key}.{name}", -9.0) for name in rotations] for key in ("sd_deg", "flags")])
print(json.dumps(rows), flush=True)
os._exit(0)  # this version of the reader crashes where it ends
"""


def read_fbx(path: Path, motion: HandMotion, bone: str = "RightHand") -> Read:
    pytest.importorskip("ufbx", reason="ufbx, an independent reader of FBX, has no package for this computer")
    asked = [str(path), str(len(motion.time_s)), " ".join(motion.rotations), bone]
    done = subprocess.run(
        [sys.executable, "-I", "-c", UFBX, *asked], capture_output=True, text=True, check=True
    )
    rows = np.array(json.loads(done.stdout))
    return {"sd": rows[:, 0], "flags": rows[:, 1]}


def read_glb(path: Path, motion: HandMotion) -> Read:
    document: Any = pygltflib.GLTF2.load_binary(str(path))
    said = document.animations[0].extras["glovecal"]["right"]
    assert tuple(said["rotations"]) == motion.rotations

    def numbers(accessor: int, kind: str) -> np.ndarray:
        view = document.bufferViews[document.accessors[accessor].bufferView]
        blob = document.binary_blob()[view.byteOffset : view.byteOffset + view.byteLength]
        return np.frombuffer(blob, kind).reshape(len(motion.time_s), -1)

    return {"sd": numbers(said["sd_deg"], "<f4"), "flags": numbers(said["flags"], "u1")}


USD: Any = pxr  # no types


def read_usd(path: Path, motion: HandMotion) -> Read:
    stage = USD.Usd.Stage.Open(str(path))
    animation = stage.GetPrimAtPath("/Hands/Skeleton/Animation")
    assert tuple(animation.GetAttribute("glovecal:right:rotations").Get()) == motion.rotations
    rows = {}
    for name, key in (("sd", "sd_deg"), ("flags", "flags")):
        attribute = animation.GetAttribute(f"glovecal:right:{key}")
        rows[name] = np.array([attribute.Get(at) for at in attribute.GetTimeSamples()])
    return rows


def read_c3d(path: Path, motion: HandMotion) -> Read:
    pytest.importorskip("ezc3d", reason="ezc3d has no package for Linux on ARM")
    with path.open("rb") as stream, warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        read = c3d.Reader(stream)
        labels = [label.strip() for label in read.analog_labels]
        assert read.analog_rate == pytest.approx(RATE_HZ, rel=1e-6)
        rows = np.array([analogue[:, 0] for _, _, analogue in read.read_frames()])
    return {
        name: rows[:, [labels.index(f"R_{name}.{rotation}") for rotation in motion.rotations]]
        for name in ("sd", "flags")
    }


READERS: dict[str, Callable[[Path, HandMotion], Read]] = {
    ".fbx": read_fbx, ".glb": read_glb, ".usda": read_usd, ".c3d": read_c3d,
}  # fmt: skip


@pytest.mark.parametrize("suffix", READERS)
def test_deviations_and_flags_are_read_back(tmp_path: Path, suffix: str) -> None:
    motion, path = doubtful(), tmp_path / f"both{suffix}"
    FORMATS[suffix].write([motion, moving("L")], "joints", path)
    read = READERS[suffix](path, motion)
    np.testing.assert_array_equal(read["flags"], motion.flags)
    wanted = np.where(np.isfinite(motion.sd_deg), motion.sd_deg, NOT_KNOWN)
    # FBX is asked a little after each frame, and its curves go straight from key to key
    np.testing.assert_allclose(read["sd"], wanted, atol=5e-3 if suffix == ".fbx" else 1e-5)


def test_flags_have_a_topic_of_joint_states(tmp_path: Path) -> None:
    motion = doubtful()
    FORMATS[".mcap"].write([motion], "angles", tmp_path / "one.mcap")
    types = get_typestore(Stores.ROS2_JAZZY)
    names, rows = (), []
    with (tmp_path / "one.mcap").open("rb") as stream:
        for schema, _, one in make_reader(stream).iter_messages(topics=["/glovecal/right/flags"]):
            message: Any = types.deserialize_cdr(one.data, schema.name if schema else "")
            names, rows = message.name, [*rows, message.position]
    assert tuple(names) == motion.rotations
    np.testing.assert_array_equal(rows, motion.flags)


def test_a_motion_that_was_measured_has_no_flags(tmp_path: Path) -> None:
    for suffix in (".glb", ".usda", ".fbx"):
        FORMATS[suffix].write([moving()], "joints", tmp_path / f"one{suffix}")
        content = (tmp_path / f"one{suffix}").read_bytes()
        assert b"sd_deg" in content
        assert b"flags" not in content


@pytest.mark.parametrize("suffix", [".glb", ".fbx"])
def test_they_travel_on_a_character_too(tmp_path: Path, suffix: str) -> None:
    motion, path, moved = doubtful(), tmp_path / f"character{suffix}", tmp_path / f"moved{suffix}"
    write = write_character if suffix == ".glb" else write_fbx_character
    write(path, "mixamo")
    read_character(path, path.name).write([motion], "joints", moved, {})
    read = read_glb(moved, motion) if suffix == ".glb" else read_fbx(moved, motion, "mixamorig:RightHand")
    np.testing.assert_array_equal(read["flags"], motion.flags)
