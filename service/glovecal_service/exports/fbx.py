"""FBX 7.4, binary, for MotionBuilder, Maya, Unreal and Unity: a skeleton of limb nodes, one animation; cm.

Nothing that is kept writes it from Python, so this does. Angles are Euler angles in the order X, Y, Z about
fixed axes; key frames stand at the frames' own times. Standard deviations and flags are animated properties
of the hand's bone: ``sd_deg.I_MCP``, -1 where not known, and ``flags.I_MCP``.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path

import numpy as np

from glovecal_service.exports.body_motion import BODY_AXES, SKELETAL, BodyMotion, Bone, heads_mm, with_ends
from glovecal_service.exports.character import NAME
from glovecal_service.exports.fbx_animation import (
    TURN,
    Animated,
    Animation,
    channels_of,
    euler_curves,
)
from glovecal_service.exports.fbx_records import CREATED, FILE_ID, VERSION, Records, Value
from glovecal_service.exports.hand_motion import ALL_CHANNELS, Content, ExportFormat, HandMotion

MM_PER_UNIT = 10.0
CUSTOM_RATE = 14
FIRST_ID, IDS_A_BONE = 1_000_000, 10
"""Of a bone: its node, and from there on what follows."""
ATTRIBUTE, POSE, ANIMATION = np.int64(1), np.int64(1), np.int64(2_000_000)


def write_fbx(motions: Sequence[HandMotion], content: Content, path: Path) -> None:
    """Hands on one time, on one body. Raises BadInput for raw readings."""
    body = BodyMotion.of(motions, content, FORMAT.suffix)
    bones = with_ends(body.bones)
    ids = {bone.name: np.int64(FIRST_ID + IDS_A_BONE * number) for number, bone in enumerate(bones)}
    count = len(body.time_s)
    with tempfile.TemporaryFile(dir=path.parent) as scratch, path.open("wb") as stream:
        curves = euler_curves(body.turns(), count, ["xyz"] * len(body.moving), scratch)
        turned = [
            Animated(ids[name], TURN, tuple("XYZ"), own)
            for name, own in zip(body.moving, curves, strict=True)
        ]
        beside_angles = (channels_of(ids[bone], motion) for bone, motion in body.by_hand_bone.items())
        animated = [*turned, *chain.from_iterable(beside_angles)]
        animation = Animation(ANIMATION, body.time_s - body.time_s[0], animated, body.notes)
        _write(Records(stream), body, bones, ids, animation)


def _write(
    records: Records,
    body: BodyMotion,
    bones: Sequence[Bone],
    ids: Mapping[str, np.int64],
    animation: Animation,
) -> None:
    time_s = body.time_s
    records.begin_file()
    _write_head(records, float(1 / np.median(np.diff(time_s))) if len(time_s) > 1 else 1.0)
    _write_counts(records, len(bones), animation.counts)
    with records.record("Objects"):
        _write_skeleton(records, body, bones, ids, animation)
        _write_pose(records, bones, ids)
        animation.write_objects(records)
    with records.record("Connections"):
        for bone in bones:
            records.connect(ids[bone.name], np.int64(0) if bone.parent is None else ids[bone.parent])
            records.connect(ids[bone.name] + ATTRIBUTE, ids[bone.name])
        animation.write_connections(records)
    with records.record("Takes"):
        records.leaf("Current", NAME)
        animation.write_take(records)
    records.end_file()


def _write_head(records: Records, rate_hz: float) -> None:
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


def _write_counts(records: Records, bones: int, animated: Mapping[str, int]) -> None:
    counts = {"GlobalSettings": 1, "NodeAttribute": bones, "Model": bones, "Pose": 1, **animated}
    with records.record("Definitions"):
        records.leaf("Version", 100)
        records.leaf("Count", sum(counts.values()))
        for kind, count in counts.items():
            with records.record("ObjectType", kind):
                records.leaf("Count", count)


def _write_skeleton(
    records: Records,
    body: BodyMotion,
    bones: Sequence[Bone],
    ids: Mapping[str, np.int64],
    animation: Animation,
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
                *animation.declared(ids[bone.name]),
            )


def _write_pose(records: Records, bones: Sequence[Bone], ids: Mapping[str, np.int64]) -> None:
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


FORMAT = ExportFormat(
    ".fbx", "application/octet-stream", write_fbx, SKELETAL, "FBX 7.4, binary",
    unit="cm", axes=BODY_AXES, times="the frames' own", accuracy=ALL_CHANNELS,
    read_by="MotionBuilder, Maya, Unreal, Unity, Blender",
)  # fmt: skip
