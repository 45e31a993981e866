"""glTF 2.0, binary (.glb): skeleton, skin and animation in one file for viewers and engines; metres.

The file is JSON and one block of binary numbers, written here block by block, as what is exported may be
hours long. Standard deviations and flags, frame by frame, are numbers of their own, which the animation's
``extras`` name; -1 where a deviation is not known. Each bone is drawn as an octahedron, so that a viewer
shows the hands. Key frames stand at the frames' own times.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from glovecal_service.exports.body_motion import (
    BODY_AXES,
    SIDES,
    SKELETAL,
    BodyMotion,
    Bone,
    continuous_quaternions,
    drawn_bones,
    heads_mm,
    with_ends,
)
from glovecal_service.exports.hand_motion import ALL_CHANNELS, Content, ExportFormat, HandMotion

MM_PER_UNIT = 1000.0
MAGIC, VERSION, JSON_CHUNK, BINARY_CHUNK = 0x46546C67, 2, 0x4E4F534A, 0x004E4942
VERTICES, CORNERS = 34962, 34963
"""What a viewer hands to the graphics card: a view of vertices, or of the corners of triangles."""
UNSIGNED_BYTE, UNSIGNED_SHORT, FLOAT = 5121, 5123, 5126
_SIZES = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_TYPES = {UNSIGNED_BYTE: "<u1", UNSIGNED_SHORT: "<u2", FLOAT: "<f4"}


def write_gltf(motions: Sequence[HandMotion], content: Content, path: Path) -> None:
    """Hands on one time, on one body. Raises BadInput for raw readings."""
    body = BodyMotion.of(motions, content, FORMAT.suffix)
    bones = with_ends(body.bones)
    numbers = BinaryNumbers()
    mesh = _mesh(bones, numbers)
    count = len(body.time_s)
    time_s = body.time_s - body.time_s[0]
    times = numbers.add(FLOAT, "SCALAR", time_s, low=[0.0], high=[float(np.float32(time_s[-1]))])
    turns = [numbers.room(FLOAT, "VEC4", count) for _ in body.moving]
    names = [bone.name for bone in bones]
    channels = [
        {"sampler": number, "target": {"node": names.index(bone), "path": "rotation"}}
        for number, bone in enumerate(body.moving)
    ]
    samplers = [{"input": times, "output": one, "interpolation": "LINEAR"} for one in turns]
    channels_by_hand = {SIDES[motion.label].lower(): channels_of(motion, numbers) for motion in body.motions}
    skin_node = len(bones)
    document = {
        "asset": {"version": "2.0", "generator": "Glovecal", "extras": body.notes},
        "scene": 0,
        "scenes": [{"nodes": [0, skin_node]}],
        "nodes": [*(_node(bone, bones) for bone in bones), {"name": "Hands", "mesh": 0, "skin": 0}],
        "meshes": [mesh],
        "skins": [
            {
                "joints": list(range(len(bones))),
                "skeleton": 0,
                "inverseBindMatrices": numbers.add(FLOAT, "MAT4", _inverse_binds(bones)),
            }
        ],
        "animations": [
            {
                "name": "take",
                "channels": channels,
                "samplers": samplers,
                "extras": {"glovecal": channels_by_hand},
            }
        ],
        "accessors": numbers.accessors,
        "bufferViews": numbers.views,
        "buffers": [{"byteLength": numbers.length}],
    }
    with path.open("wb") as stream:
        begin = write_container(stream, document, numbers)
        for which, quaternions in continuous_quaternions(body.turns()):
            for bone, accessor in enumerate(turns):
                numbers.write_at(stream, begin, accessor, which.start, quaternions[:, bone])


def channels_of(motion: HandMotion, numbers: BinaryNumbers) -> dict[str, Any]:
    """What ``extras`` say of the numbers beside the angles: rotations, and of each channel its accessor."""
    kept = {
        channel.key: numbers.add(
            UNSIGNED_BYTE if channel.is_held else FLOAT, "SCALAR", channel.numbers.reshape(-1)
        )
        for channel in motion.channels
    }
    return {"rotations": list(motion.rotations), **kept}


def write_container(stream: BinaryIO, document: Mapping[str, Any], numbers: BinaryNumbers) -> int:
    """JSON and the room for the binary block, with all that is known already; where the block begins."""
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    stream.write(struct.pack("<III", MAGIC, VERSION, 12 + 8 + len(text) + 8 + numbers.length))
    stream.write(struct.pack("<II", len(text), JSON_CHUNK) + text)
    stream.write(struct.pack("<II", numbers.length, BINARY_CHUNK))
    begin = stream.tell()
    stream.truncate(begin + numbers.length)
    numbers.write(stream, begin)
    return begin


def _node(bone: Bone, bones: Sequence[Bone]) -> dict[str, Any]:
    node = {"name": bone.name, "translation": [length / MM_PER_UNIT for length in bone.offset_mm]}
    children = [number for number, other in enumerate(bones) if other.parent == bone.name]
    return node | ({"children": children} if children else {})


def _inverse_binds(bones: Sequence[Bone]) -> np.ndarray:
    """(J, 16) column by column."""
    matrices = np.tile(np.eye(4), (len(bones), 1, 1))
    matrices[:, :3, 3] = [-head / MM_PER_UNIT for head in heads_mm(bones).values()]
    return matrices.swapaxes(1, 2).reshape(-1, 16)


def _mesh(bones: Sequence[Bone], numbers: BinaryNumbers) -> dict[str, Any]:
    places, faces, carriers = drawn_bones(bones)
    positions, joints = (places / MM_PER_UNIT).astype("<f4"), np.zeros((len(places), 4))
    joints[:, 0] = carriers
    low, high = positions.min(axis=0).tolist(), positions.max(axis=0).tolist()
    attributes = {
        "POSITION": numbers.add(FLOAT, "VEC3", positions, low=low, high=high),
        "JOINTS_0": numbers.add(UNSIGNED_BYTE, "VEC4", joints),
        "WEIGHTS_0": numbers.add(FLOAT, "VEC4", np.tile([1.0, 0.0, 0.0, 0.0], (len(places), 1))),
    }
    indices = numbers.add(UNSIGNED_SHORT, "SCALAR", faces.reshape(-1))
    for accessor, target in (*((one, VERTICES) for one in attributes.values()), (indices, CORNERS)):
        numbers.view_of(accessor)["target"] = target
    return {"name": "Bones", "primitives": [{"attributes": attributes, "indices": indices}]}


@dataclass
class BinaryNumbers:
    """What stands in the binary block, where; of a file that is added to, what is there comes first."""

    accessors: list[dict[str, Any]] = field(default_factory=list)
    views: list[dict[str, Any]] = field(default_factory=list)
    length: int = 0
    known: dict[int, bytes] = field(default_factory=dict)

    def room(self, component: int, kind: str, count: int) -> int:
        """The number of an accessor for values that are written later."""
        size = count * _SIZES[kind] * np.dtype(_TYPES[component]).itemsize
        self.views.append({"buffer": 0, "byteOffset": self.length, "byteLength": size})
        accessor = {
            "bufferView": len(self.views) - 1,
            "componentType": component,
            "count": count,
            "type": kind,
        }
        self.accessors.append(accessor)
        self.length += size + -size % 4
        return len(self.accessors) - 1

    def add(
        self, component: int, kind: str, values: np.ndarray, *,
        low: list[float] | None = None, high: list[float] | None = None,
    ) -> int:  # fmt: skip
        """The number of an accessor of ``values``, one row an element."""
        number = self.room(component, kind, len(values))
        if low is not None:
            self.accessors[number] |= {"min": low, "max": high}
        self.known[number] = np.ascontiguousarray(values, _TYPES[component]).tobytes()
        return number

    def write(self, stream: BinaryIO, begin: int) -> None:
        """All that is known already, into the block that starts at ``begin``."""
        for number, content in self.known.items():
            stream.seek(begin + self._offset(number))
            stream.write(content)

    def write_at(self, stream: BinaryIO, begin: int, number: int, first: int, values: np.ndarray) -> None:
        """The elements of an accessor from ``first`` on."""
        content = np.ascontiguousarray(values, _TYPES[self.accessors[number]["componentType"]])
        stream.seek(begin + self._offset(number) + first * content[0].nbytes)
        stream.write(content.tobytes())

    def _offset(self, number: int) -> int:
        return self.view_of(number)["byteOffset"]

    def view_of(self, number: int) -> dict[str, Any]:
        return self.views[self.accessors[number]["bufferView"]]


FORMAT = ExportFormat(
    ".glb", "model/gltf-binary", write_gltf, SKELETAL, "glTF 2.0, binary",
    unit="m", axes=BODY_AXES, times="the frames' own, to 32 bits", accuracy=ALL_CHANNELS,
    read_by="viewers in browsers, Blender, Godot, Unity, Unreal",
)  # fmt: skip
