"""Characters as animation tools export them: a rig of another program, both hands, in one file."""

from __future__ import annotations

import json
import struct
import sys
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parents[2] / "models" / "retargeting"))

from rigs import CONVENTIONS, rig_like

from glovecal_models.hand.retargeting.rig import Rig, RigBone
from glovecal_models.hand.rotations import HANDS
from glovecal_service.exports.fbx_records import Records


def write_character(path: Path, convention: str) -> None:
    """In metres; its nodes have turns of their own, an empty mesh buffer and an animation that was there."""
    nodes: list[dict] = [{"name": "Armature", "children": []}]
    for hand in HANDS:
        numbers: dict[str, int] = {}
        rig = rig_like(CONVENTIONS[convention], hand, unit_mm=1000.0)
        for bone in rig.bones:
            parent = rig.by_name.get(bone.parent or "")
            turned, head = bone.orientation, np.array(bone.head)
            if parent is not None:
                turned = parent.orientation.T @ turned
                head = parent.orientation.T @ (head - np.array(parent.head))
            name = f"{hand} {bone.name}" if bone.parent is None else bone.name
            numbers[bone.name] = len(nodes)
            above = 0 if parent is None else numbers[parent.name]
            nodes[above].setdefault("children", []).append(len(nodes))
            nodes.append(
                {
                    "name": name,
                    "translation": head.tolist(),
                    "rotation": Rotation.from_matrix(turned).as_quat().tolist(),
                }
            )
            if bone.tail is not None:
                tail = bone.orientation.T @ (np.array(bone.tail) - np.array(bone.head))
                nodes[-1]["children"] = [len(nodes)]
                nodes.append({"name": f"{bone.name} end", "translation": tail.tolist()})
    content = b"what was there before"
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": nodes,
        "buffers": [{"byteLength": len(content)}],
    }  # fmt: skip
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    block = content + bytes(-len(content) % 4)
    path.write_bytes(
        struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(block))
        + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(block), b"BIN\x00") + block
    )  # fmt: skip


ORDERS = ("xyz", "xzy", "yzx", "yxz", "zxy", "zyx")
Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
MESH = np.arange(3000, dtype="<f8")


def both_hands(convention: str, unit_mm: float) -> Rig:
    bones: list[RigBone] = []
    for hand in HANDS:
        rig = rig_like(CONVENTIONS[convention], hand, unit_mm)
        bones += rig.bones[1 if bones else 0 :]
    return Rig(tuple(bones))


def write_fbx_character(
    path: Path, convention: str, *, version: int = 7400, metres: bool = False, has_bind_pose: bool = True,
    is_posed: bool = False, z_up: bool = True, mesh: np.ndarray = MESH,
) -> Rig:  # fmt: skip
    """The rig that it has, in the file's world. Each bone has turns before and after, an order of angles and
    pivots of its own; ``is_posed``: fingers of the file are not as in its bind pose."""
    rng = np.random.default_rng(7)
    world = Z_UP if z_up else np.eye(3)
    own = both_hands(convention, 1000.0 if metres else 10.0)
    bones = tuple(
        RigBone(bone.name, bone.parent, tuple(world @ bone.head), world @ bone.orientation)
        for bone in own.bones
    )
    rig = Rig(bones)
    ids = {bone.name: np.int64(500 + 7 * number) for number, bone in enumerate(bones)}
    with path.open("wb") as stream:
        records = Records(stream, version)
        records.begin_file()
        with records.record("GlobalSettings"):
            axes = {"UpAxis": 2, "FrontAxis": 1, "CoordAxis": 0} if z_up else {"UpAxis": 1}
            signs = {"FrontAxisSign": -1 if z_up else 1}
            records.properties(
                *((name, "int", "Integer", "", number) for name, number in (axes | signs).items()),
                ("UnitScaleFactor", "double", "Number", "", 100.0 if metres else 1.0),
            )
        with records.record("Definitions"):
            records.leaf("Count", 3 + len(bones))
            with records.record("ObjectType", "AnimationStack"):
                records.leaf("Count", 1)
            with records.record("ObjectType", "Model"):
                records.leaf("Count", len(bones))
                with records.record("PropertyTemplate", "FbxNode"):
                    records.properties(("RotationActive", "bool", "", "", 1))
        with records.record("Objects"):
            with records.object("Geometry", np.int64(90), "body", "Mesh"):
                records.leaf("Vertices", mesh)
            for bone in bones:
                with records.object("Model", ids[bone.name], bone.name, "LimbNode"):
                    bent = is_posed and any(word in bone.name.lower() for word in ("index", "metacarpal"))
                    arm_size = 1.0 if has_bind_pose else 1.2
                    records.properties(*_placed(rig, bone, rng, 20.0 if bent else 0.0, arm_size))
            if has_bind_pose:
                with records.object("Pose", np.int64(91), "bind", "BindPose"):
                    for bone in bones:
                        matrix = np.eye(4)
                        matrix[:3, :3], matrix[:3, 3] = 2.0 * bone.orientation, bone.head
                        with records.record("PoseNode"):
                            records.leaf("Node", ids[bone.name])
                            records.leaf("Matrix", np.ascontiguousarray(matrix.T))
            with records.object("AnimationStack", np.int64(92), "what was there before"):
                pass
            with records.object("AnimationLayer", np.int64(93), "before"):
                pass
        with records.record("Connections"):
            records.connect(np.int64(93), np.int64(92))
            for bone in bones:
                records.connect(ids[bone.name], ids[bone.parent] if bone.parent else np.int64(0))
        with records.record("Takes"):
            records.leaf("Current", "what was there before")
        records.end_file()
    return rig


def _placed(
    rig: Rig, bone: RigBone, rng: np.random.Generator, bent_deg: float, arm_size: float
) -> list[tuple]:
    parent = rig.by_name.get(bone.parent or "")
    above = np.eye(3) if parent is None else parent.orientation
    turn = above.T @ bone.orientation @ Rotation.from_euler("x", bent_deg, degrees=True).as_matrix()
    place = above.T @ (np.array(bone.head) - (np.zeros(3) if parent is None else np.array(parent.head)))
    before, after = rng.uniform(-70, 70, (2, 3))
    number = int(rng.integers(len(ORDERS)))
    pre, post = (Rotation.from_euler("xyz", each, degrees=True).as_matrix() for each in (before, after))
    angles = Rotation.from_matrix(pre.T @ turn @ post).as_euler(ORDERS[number], degrees=True)
    turned = [float(angles[ORDERS[number].index(axis)]) for axis in "xyz"]
    offset, pivot, size_offset, size_pivot = rng.uniform(-3, 3, (4, 3))
    place = place - offset - pivot - turn @ (size_offset - pivot)

    def row(name: str, values: np.ndarray | list[float]) -> tuple:
        return (name, name if name.startswith("Lcl") else "Vector3D", "", "A", *map(float, values))

    return [
        ("RotationOrder", "enum", "", "", number), ("InheritType", "enum", "", "", int(rng.integers(3))),
        row("PreRotation", before), row("PostRotation", after), row("RotationOffset", offset),
        row("RotationPivot", pivot), row("ScalingOffset", size_offset), row("ScalingPivot", size_pivot),
        row("Lcl Translation", place), row("Lcl Rotation", turned),
        row("Lcl Scaling", [arm_size if "forearm" in bone.name else 1.0] * 3),
    ]  # fmt: skip
