"""A take on an FBX character: another reader finds every bone turned as it was retargeted."""

from __future__ import annotations

import io
import json
import subprocess
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parent))

from characters import MESH, write_fbx_character
from posed_hands import RATE_HZ, moving

from glovecal_models.errors import BadInput
from glovecal_service.exports.body_motion import whole_angles
from glovecal_service.exports.character import MovingHand
from glovecal_service.exports.character_files import read_character
from glovecal_service.exports.fbx_character import FbxCharacter
from glovecal_service.exports.fbx_records import HEAD, RecordFile, Records

UFBX = """
import json, os, sys, ufbx
scene, kept, bones = ufbx.load_file(sys.argv[1]), [], {}
listed = scene.anim_stacks
stacks = [listed[number] for number in range(len(listed))]
still, names = scene, [stack.name for stack in stacks]
if sys.argv[2]:
    anim = stacks[names.index("Glovecal take")].anim
    still = ufbx.evaluate_scene(scene, anim, float(sys.argv[2]))
for bone in scene.nodes:
    if bone.name:
        node = still.find_node(bone.name)
        matrix = node.node_to_world
        columns = [matrix.c0, matrix.c1, matrix.c2, matrix.c3]
        kept += [bone, node, matrix, columns]  # this version of the reader crashes where one of them is gone
        bones[bone.name] = [[column.x, column.y, column.z] for column in columns]
print(json.dumps({"bones": bones, "stacks": names}), flush=True)
os._exit(0)  # and where it ends
"""


def read_by_another(path: Path, time_s: float | None = None) -> tuple[dict[str, np.ndarray], list[str]]:
    """(3, 4) in the file's world by bone, at rest or in the take; the animations that there are."""
    pytest.importorskip("ufbx", reason="ufbx, an independent reader of FBX, has no package for this computer")
    asked = [str(path), "" if time_s is None else str(time_s)]
    done = subprocess.run(
        [sys.executable, "-I", "-c", UFBX, *asked], capture_output=True, text=True, check=True
    )
    answer = json.loads(done.stdout)
    return {name: np.array(rows).T for name, rows in answer["bones"].items()}, answer["stacks"]


def away_deg(one: np.ndarray, other: np.ndarray) -> float:
    """Between two orientations, of any size."""
    axes = [each / np.linalg.norm(each, axis=0) for each in (one, other)]
    return float(np.degrees(np.linalg.norm(axes[0] - axes[1]) / np.sqrt(2)))


VARIANTS = {
    "mixamo": {"metres": False},
    "unreal": {"metres": True, "has_bind_pose": False, "version": 7500},
    "vrm": {"z_up": False, "version": 7700},
}


@pytest.mark.parametrize("convention", VARIANTS)
def test_at_rest_bones_are_where_another_reader_has_them(tmp_path: Path, convention: str) -> None:
    own = write_fbx_character(tmp_path / "character.fbx", convention, **VARIANTS[convention])
    rig = read_character(tmp_path / "character.fbx", "character.fbx").rig
    seen, _ = read_by_another(tmp_path / "character.fbx")
    assert set(rig.by_name) == set(own.by_name) == set(seen)
    for name, bone in rig.by_name.items():
        assert bone.parent == own.by_name[name].parent
        np.testing.assert_allclose(bone.head, seen[name][:, 3], atol=1e-6)
        assert away_deg(bone.orientation, seen[name][:, :3]) < 1e-5


@pytest.mark.parametrize("convention", VARIANTS)
def test_another_reader_finds_every_bone_turned_as_it_was_retargeted(tmp_path: Path, convention: str) -> None:
    write_fbx_character(tmp_path / "character.fbx", convention, **VARIANTS[convention])
    character = read_character(tmp_path / "character.fbx", "character.fbx")
    hands = [moving("R"), moving("L")]
    character.write(hands, "joints", tmp_path / "moved.fbx", {})
    made = [MovingHand(character.shown(hand.skeleton, {}), whole_angles(hand)) for hand in hands]
    wanted = [dict(zip(one.names, next(one.oriented())[1].swapaxes(0, 1), strict=True)) for one in made]

    def worst_deg(seen: dict[str, np.ndarray], frame: int) -> float:
        turns = [(name, turns[frame]) for hand in wanted for name, turns in hand.items()]
        return max(away_deg(seen[name][:, :3], turn) for name, turn in turns)

    for frame in (0, 7):
        seen, stacks = read_by_another(tmp_path / "moved.fbx", frame / RATE_HZ)
        assert stacks == ["what was there before", "Glovecal take"]
        assert worst_deg(seen, frame) < 1e-4
        assert worst_deg(seen, frame + 1) > 1.0


def test_a_file_in_another_pose_than_its_bind_pose_moves_alike(tmp_path: Path) -> None:
    for name, is_posed in (("rest", False), ("posed", True)):
        write_fbx_character(tmp_path / f"{name}.fbx", "unreal", is_posed=is_posed)
        character = read_character(tmp_path / f"{name}.fbx", name)
        character.write([moving("R")], "joints", tmp_path / f"{name}-moved.fbx", {})
    at_rest, posed = (read_by_another(tmp_path / f"{name}.fbx")[0] for name in ("rest", "posed"))
    assert away_deg(at_rest["index_01_r"][:, :3], posed["index_01_r"][:, :3]) > 5.0
    first, second = (read_by_another(tmp_path / f"{name}-moved.fbx", 0.1)[0] for name in ("rest", "posed"))
    for name in (name for name in first if name.endswith("_r")):
        assert away_deg(first[name][:, :3], second[name][:, :3]) < 1e-4, name


def test_everything_else_stays(tmp_path: Path) -> None:
    write_fbx_character(tmp_path / "character.fbx", "mixamo")
    character = read_character(tmp_path / "character.fbx", "character.fbx")
    character.write([moving("R")], "joints", tmp_path / "moved.fbx", {})

    def listed(path: Path) -> list[tuple]:
        file = RecordFile(path.read_bytes(), path.name)

        def inside(above=None) -> list[tuple]:
            return [(one.name, content(one), inside(one)) for one in file.records(above)]

        def content(record) -> bytes:
            return file.content[record.values : record.inside]

        return inside()

    before, after = listed(tmp_path / "character.fbx"), listed(tmp_path / "moved.fbx")
    assert [name for name, _, _ in after] == [name for name, _, _ in before]
    assert MESH.tobytes() in (tmp_path / "moved.fbx").read_bytes()
    for (name, values, inside), (_, other_values, other_inside) in zip(before, after, strict=True):
        assert values == other_values
        if name == b"Definitions":
            assert inside[0] != other_inside[0], "how many objects there are"
            assert inside[2] == other_inside[2]
        elif name == b"Objects":
            changed = [pair for pair in zip(inside, other_inside, strict=False) if pair[0] != pair[1]]
            (((_, _, [(_, _, rows)]), (_, _, [(_, _, other_rows)])),) = changed
            assert other_rows[: len(rows)] == rows, "the hand's bone has properties more"
        else:
            assert other_inside[: len(inside)] == inside
    assert b"wave" in (tmp_path / "moved.fbx").read_bytes(), "which take it was"


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"; FBX 7.4.0 project file", r"is FBX as text \(ASCII\). Export the character again as binary FBX"),
        (b"nothing of the kind", "does not begin as glTF does, nor as FBX"),
        (HEAD + b"\xd4\x17\x00\x00", "is FBX 6.1; 7.4 to 7.7 are read"),
        (HEAD + b"\xe8\x1c\x00\x00", "has no objects"),
        (HEAD + b"\xe8\x1c\x00\x00" + b"\xff" * 60, "is damaged at byte 27"),
    ],
)
def test_what_is_no_character_is_refused(tmp_path: Path, content: bytes, why: str) -> None:
    (tmp_path / "odd.fbx").write_bytes(content)
    with pytest.raises(BadInput, match=why):
        read_character(tmp_path / "odd.fbx", "odd.fbx")


def test_left_handed_axes_are_refused(tmp_path: Path) -> None:
    write_fbx_character(tmp_path / "character.fbx", "mixamo")
    content = (tmp_path / "character.fbx").read_bytes()
    (tmp_path / "mirrored.fbx").write_bytes(content.replace(b"\xff\xff\xff\xff", b"\x01\x00\x00\x00", 1))
    with pytest.raises(BadInput, match="left-handed axes"):
        read_character(tmp_path / "mirrored.fbx", "mirrored.fbx")


def test_an_array_that_would_swell_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bomb.fbx"
    write_fbx_character(path, "mixamo")
    content = bytearray(path.read_bytes())
    at = content.index(b"Matrixd") + len(b"Matrixd")
    content[at : at + 4] = (1 << 30).to_bytes(4, "little")
    path.write_bytes(content)
    with pytest.raises(BadInput, match="1073741824 numbers where at most 4096 are expected"):
        read_character(path, "bomb.fbx")


def test_what_a_large_file_takes_is_bounded(tmp_path: Path) -> None:
    path = tmp_path / "large.fbx"
    write_fbx_character(path, "mixamo", mesh=np.zeros(2_000_000))
    tracemalloc.start()
    character = read_character(path, "large.fbx")
    character.write([moving("R", count=2)], "joints", tmp_path / "moved.fbx", {})
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 3 * path.stat().st_size
    assert (tmp_path / "moved.fbx").stat().st_size > path.stat().st_size


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("whole") / "whole.fbx"
    write_fbx_character(path, "mixamo")
    return path.read_bytes()


@given(data=st.data())
def test_a_damaged_file_is_read_or_refused_by_a_sentence(tmp_path_factory, whole: bytes, data) -> None:
    content = bytearray(whole)
    for _ in range(data.draw(st.integers(0, 4))):
        at = data.draw(st.integers(0, len(content) - 1))
        wild = data.draw(st.binary(min_size=1, max_size=8))
        content[at : at + len(wild)] = wild
    if data.draw(st.booleans()):
        del content[data.draw(st.integers(0, len(content))) :]
    path = tmp_path_factory.mktemp("wild") / "wild.fbx"
    path.write_bytes(content)
    refused = ""
    try:
        assert FbxCharacter.read(path, "wild.fbx").rig.bones
        file = RecordFile(bytes(content), "wild.fbx")
        records = Records(io.BytesIO(), file.version)
        for record in file.records():
            file.copy(record, records)
    except BadInput as error:
        refused = str(error)
    assert not refused or ("wild.fbx" in refused and "xport the character" in refused)


def test_records_are_read_as_they_were_written(tmp_path: Path) -> None:
    values = (True, 5, np.int64(-(1 << 40)), 2.5, "text", b"\x00bytes")
    for version in (7400, 7500):
        with (tmp_path / "one.fbx").open("wb") as stream:
            records = Records(stream, version)
            records.begin_file()
            with records.record("Outer", *values):
                records.leaf("Inner", np.arange(4, dtype="<f4"))
            records.end_file()
        file = RecordFile((tmp_path / "one.fbx").read_bytes(), "one.fbx")
        (outer,) = file.records()
        assert list(file.values(outer)) == [True, 5, -(1 << 40), 2.5, b"text", b"\x00bytes"]
        (inner,) = file.records(outer)
        np.testing.assert_array_equal(next(file.values(inner)), np.arange(4))
