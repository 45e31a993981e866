"""FBX 7.4, binary, for MotionBuilder, Maya, Unreal and Unity: a skeleton of limb nodes, one animation; cm.

Nothing that is kept writes it from Python, so this does: records of a name, properties and further records.
Angles are Euler angles in the order X, Y, Z about fixed axes, unrolled, so that between two key frames a bone
does not turn the long way round; key frames stand at the frames' own times.
"""

from __future__ import annotations

import json
import struct
import tempfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from glovecal_service.exports.body_motion import BODY_AXES, SKELETAL, BodyMotion, Bone, heads_mm, with_ends
from glovecal_service.exports.hand_motion import Content, ExportFormat, HandMotion

MM_PER_UNIT = 10.0
HEAD = b"Kaydara FBX Binary  \x00\x1a\x00"
VERSION = 7400
TICKS_PER_S = 46_186_158_000
NO_RECORD = bytes(13)
CREATED = "1970-01-01 10:00:00:000"
FILE_ID = bytes.fromhex("28b32aebb624ccc2bfc8b02aa92bfcf1")
FOOTER_ID = bytes.fromhex("fabcab09d0c8d466b176fb831cf7267e")
FOOTER_END = bytes.fromhex("f85a8c6adef5d97eece90ce3758f290b")
"""The time and the three marks belong together: readers check the marks against the time."""
CUSTOM_RATE = 14
LINEAR = 4
"""Between key frames."""
Value = bool | int | np.int64 | float | str | bytes | np.ndarray
"""``int`` is written in 32 bits, ``np.int64`` in 64."""
FIRST_ID, IDS_A_BONE = 1_000_000, 10
"""Of a bone: its node, and from there on what follows."""
ATTRIBUTE, TURNS, CURVES = np.int64(1), np.int64(2), np.int64(3)
STACK, LAYER, POSE = np.int64(1), np.int64(2), np.int64(3)


def write_fbx(motions: Sequence[HandMotion], content: Content, path: Path) -> None:
    """Hands on one time, on one body. Raises BadInput for raw readings."""
    body = BodyMotion.of(motions, content, FORMAT.suffix)
    with tempfile.TemporaryFile(dir=path.parent) as scratch, path.open("wb") as stream:
        _write(_Records(stream), body, _curves(body, scratch))


def _curves(body: BodyMotion, scratch: BinaryIO) -> np.ndarray:
    """(B, 3, N) degrees of the bones that move, in a file: by frame as they come, by curve as they are
    written."""
    from scipy.spatial.transform import Rotation  # slow to load, and every command that exports loads this

    shape = (len(body.moving), 3, len(body.time_s))
    scratch.truncate(max(4 * int(np.prod(shape)), 1))
    curves = np.memmap(scratch, "<f4", shape=shape)
    last = np.zeros((1, shape[0], 3))
    for which, turns in body.turns():
        angles = Rotation.from_matrix(turns.reshape(-1, 3, 3)).as_euler("xyz", degrees=True)
        unrolled = np.unwrap(np.concatenate([last, angles.reshape(-1, shape[0], 3)]), axis=0, period=360.0)
        last = unrolled[-1:]
        curves[:, :, which] = unrolled[1:].transpose(1, 2, 0)
    return curves


@dataclass(frozen=True)
class _Compressed:
    """An array of int64 that many curves share, compressed once."""

    count: int
    content: bytes

    @classmethod
    def of(cls, values: np.ndarray) -> _Compressed:
        return cls(len(values), zlib.compress(values.astype("<i8").tobytes(), 1))


class _Records:
    """Writes records. What a record takes is known when it is whole: then its head is written again."""

    def __init__(self, stream: BinaryIO) -> None:
        self.stream = stream

    @contextmanager
    def record(self, name: str, *values: Value | _Compressed) -> Iterator[None]:
        """A record of other records."""
        begin = self._begin(name, values)
        yield
        self.stream.write(NO_RECORD)
        self._end(begin)

    def leaf(self, name: str, *values: Value | _Compressed) -> None:
        """A record of values only."""
        self._end(self._begin(name, values))

    def _begin(self, name: str, values: Sequence[Value | _Compressed]) -> int:
        begin, text = self.stream.tell(), b"".join(map(_encoded, values))
        self.stream.write(struct.pack("<III", 0, len(values), len(text)) + bytes([len(name)]))
        self.stream.write(name.encode("ascii") + text)
        return begin

    def _end(self, begin: int) -> None:
        end = self.stream.tell()
        self.stream.seek(begin)
        self.stream.write(struct.pack("<I", end))
        self.stream.seek(end)

    @contextmanager
    def object(self, kind: str, id: np.int64, name: str, said: str = "") -> Iterator[None]:
        """A record that others are connected with."""
        kind_of_name = kind.replace("Animation", "Anim")
        with self.record(kind, id, f"{name}\x00\x01{kind_of_name}", said):
            yield

    def properties(self, *rows: tuple[str | Value, ...]) -> None:
        """Each: name, type, label, flags and values."""
        with self.record("Properties70"):
            for row in rows:
                self.leaf("P", *row)


def _encoded(value: Value | _Compressed) -> bytes:
    match value:
        case bool():
            return b"C" + bytes([value])
        case int():
            return struct.pack("<ci", b"I", value)
        case float():
            return struct.pack("<cd", b"D", value)
        case bytes():
            return struct.pack("<cI", b"R", len(value)) + value
        case str():
            return struct.pack("<cI", b"S", len(value.encode())) + value.encode()
        case _Compressed():
            return struct.pack("<cIII", b"l", value.count, 1, len(value.content)) + value.content
    if value.ndim == 0:
        return struct.pack("<cq", b"L", int(value))
    kind = {"f4": b"f", "f8": b"d", "i4": b"i"}[value.dtype.str[1:]]
    return struct.pack("<cIII", kind, value.size, 0, value.nbytes) + value.tobytes()


def _write(records: _Records, body: BodyMotion, curves: np.ndarray) -> None:
    stream, bones = records.stream, with_ends(body.bones)
    ids = {bone.name: np.int64(FIRST_ID + IDS_A_BONE * number) for number, bone in enumerate(bones)}
    ticks = np.round((body.time_s - body.time_s[0]) * TICKS_PER_S).astype(np.int64)
    stream.write(HEAD + struct.pack("<I", VERSION))
    _write_head(records, float(1 / np.median(np.diff(body.time_s))) if len(ticks) > 1 else 1.0)
    _write_counts(records, len(bones), len(curves))
    with records.record("Objects"):
        _write_skeleton(records, body, bones, ids)
        _write_pose(records, bones, ids)
        with records.object("AnimationStack", STACK, "take"):
            ends = {"Start": np.int64(0), "Stop": ticks[-1]}
            rows = [(f"{span}{end}", at) for span in ("Local", "Reference") for end, at in ends.items()]
            records.properties(*((name, "KTime", "Time", "", at) for name, at in rows))
        with records.object("AnimationLayer", LAYER, "take"):
            pass
        _write_curves(records, body, curves, ids, ticks)
    with records.record("Connections"):
        _write_connections(records, body, bones, ids)
    with records.record("Takes"):
        records.leaf("Current", "take")
    stream.write(NO_RECORD + FOOTER_ID + bytes(4))
    stream.write(bytes(-stream.tell() % 16 or 16) + struct.pack("<I", VERSION) + bytes(120) + FOOTER_END)


def _write_head(records: _Records, rate_hz: float) -> None:
    with records.record("FBXHeaderExtension"):
        records.leaf("FBXHeaderVersion", 1003)
        records.leaf("FBXVersion", VERSION)
        records.leaf("Creator", "Glovecal")
    records.leaf("FileId", FILE_ID)
    records.leaf("CreationTime", CREATED)
    records.leaf("Creator", "Glovecal")
    with records.record("GlobalSettings"):
        records.leaf("Version", 1000)
        axes = {"UpAxis": (1, 1), "FrontAxis": (2, 1), "CoordAxis": (0, 1), "OriginalUpAxis": (1, 1)}
        rows: list[tuple[str | Value, ...]] = []
        for name, (axis, sign) in axes.items():
            rows += [(name, "int", "Integer", "", axis), (f"{name}Sign", "int", "Integer", "", sign)]
        records.properties(
            *rows,
            ("UnitScaleFactor", "double", "Number", "", 1.0),
            ("OriginalUnitScaleFactor", "double", "Number", "", 1.0),
            ("TimeMode", "enum", "", "", CUSTOM_RATE),
            ("CustomFrameRate", "double", "Number", "", rate_hz),
        )
    with records.record("Documents"):
        records.leaf("Count", 0)
    with records.record("References"):
        pass


def _write_counts(records: _Records, bones: int, moving: int) -> None:
    counts = {
        "GlobalSettings": 1, "NodeAttribute": bones, "Model": bones, "Pose": 1, "AnimationStack": 1,
        "AnimationLayer": 1, "AnimationCurveNode": moving, "AnimationCurve": 3 * moving,
    }  # fmt: skip
    with records.record("Definitions"):
        records.leaf("Version", 100)
        records.leaf("Count", sum(counts.values()))
        for kind, count in counts.items():
            with records.record("ObjectType", kind):
                records.leaf("Count", count)


def _write_skeleton(
    records: _Records, body: BodyMotion, bones: Sequence[Bone], ids: Mapping[str, np.int64]
) -> None:
    for bone in bones:
        with records.object("NodeAttribute", ids[bone.name] + ATTRIBUTE, bone.name, "LimbNode"):
            records.leaf("TypeFlags", "Skeleton")
    for bone in bones:
        with records.object("Model", ids[bone.name], bone.name, "LimbNode"):
            records.leaf("Version", 232)
            offset = [length / MM_PER_UNIT for length in bone.offset_mm]
            notes = [("glovecal", "KString", "", "U", json.dumps(body.notes))] if bone.parent is None else []
            records.properties(
                ("InheritType", "enum", "", "", 1),
                ("Lcl Translation", "Lcl Translation", "", "A", *offset),
                ("Lcl Rotation", "Lcl Rotation", "", "A", 0.0, 0.0, 0.0),
                ("Lcl Scaling", "Lcl Scaling", "", "A", 1.0, 1.0, 1.0),
                *notes,
            )


def _write_pose(records: _Records, bones: Sequence[Bone], ids: Mapping[str, np.int64]) -> None:
    """Nothing turned."""
    heads = heads_mm(bones)
    with records.object("Pose", POSE, "rest", "BindPose"):
        records.leaf("Type", "BindPose")
        records.leaf("Version", 100)
        records.leaf("NbPoseNodes", len(bones))
        for bone in bones:
            matrix = np.eye(4)
            matrix[3, :3] = heads[bone.name] / MM_PER_UNIT
            with records.record("PoseNode"):
                records.leaf("Node", ids[bone.name])
                records.leaf("Matrix", matrix)


def _write_curves(
    records: _Records, body: BodyMotion, curves: np.ndarray, ids: Mapping[str, np.int64], ticks: np.ndarray
) -> None:
    times = _Compressed.of(ticks)
    for name, axes in zip(body.moving, curves, strict=True):
        with records.object("AnimationCurveNode", ids[name] + TURNS, name):
            records.properties(
                *((f"d|{'XYZ'[axis]}", "Number", "", "A", float(axes[axis, 0])) for axis in range(3))
            )
        for axis in range(3):
            with records.object("AnimationCurve", ids[name] + CURVES + axis, name):
                records.leaf("Default", float(axes[axis, 0]))
                records.leaf("KeyVer", 4008)
                records.leaf("KeyTime", times)
                records.leaf("KeyValueFloat", np.ascontiguousarray(axes[axis]))
                records.leaf("KeyAttrFlags", np.array([LINEAR], "<i4"))
                records.leaf("KeyAttrDataFloat", np.zeros(4, "<f4"))
                records.leaf("KeyAttrRefCount", np.array([len(ticks)], "<i4"))


def _write_connections(
    records: _Records, body: BodyMotion, bones: Sequence[Bone], ids: Mapping[str, np.int64]
) -> None:
    def join(child: np.int64, parent: np.int64, *place: str) -> None:
        records.leaf("C", "OP" if place else "OO", child, parent, *place)

    for bone in bones:
        join(ids[bone.name], np.int64(0) if bone.parent is None else ids[bone.parent])
        join(ids[bone.name] + ATTRIBUTE, ids[bone.name])
    join(LAYER, STACK)
    for name in body.moving:
        join(ids[name] + TURNS, LAYER)
        join(ids[name] + TURNS, ids[name], "Lcl Rotation")
        for axis in range(3):
            join(ids[name] + CURVES + axis, ids[name] + TURNS, f"d|{'XYZ'[axis]}")


FORMAT = ExportFormat(
    ".fbx", "application/octet-stream", write_fbx, SKELETAL, "FBX 7.4, binary",
    unit="cm", axes=BODY_AXES, times="the frames' own", accuracy="nothing",
    read_by="MotionBuilder, Maya, Unreal, Unity, Blender",
)  # fmt: skip
