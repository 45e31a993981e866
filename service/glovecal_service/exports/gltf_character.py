"""A character as a binary glTF file (.glb)."""

from __future__ import annotations

import json
import shutil
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from glovecal_models.documents import read_json
from glovecal_models.errors import BadInput
from glovecal_models.hand.retargeting.rig import Rig, RigBone
from glovecal_service.exports.body_motion import SIDES, continuous_quaternions
from glovecal_service.exports.character import (
    DEEPEST,
    MOST_LISTED,
    NAME,
    Character,
    MovingHand,
    axes_of,
    distinct,
    notes_of,
)
from glovecal_service.exports.gltf import (
    BINARY_CHUNK,
    FLOAT,
    JSON_CHUNK,
    MAGIC,
    BinaryNumbers,
    channels_of,
    write_container,
)
from glovecal_service.exports.hand_motion import HandMotion

LARGEST_JSON = 64_000_000
RIGHT = "is it a binary glTF 2.0 file (.glb)? Export the character again"


@dataclass(frozen=True)
class GltfCharacter(Character):
    suffix = ".glb"
    path: Path
    document: dict[str, Any]
    begins: int
    """Where the binary block begins in the file."""
    length: int

    @classmethod
    def read(cls, path: Path, name: str) -> GltfCharacter:
        with path.open("rb") as stream:
            head = stream.read(20)
            if len(head) < 20 or struct.unpack("<I", head[:4])[0] != MAGIC:
                raise BadInput(f"{name} does not begin as glTF does; {RIGHT}")
            length, kind = struct.unpack("<II", head[12:20])
            if kind != JSON_CHUNK or length > LARGEST_JSON:
                raise BadInput(f"{name} has no description of its scene, or one of {length} bytes; {RIGHT}")
            document = read_json(stream.read(length), name)
            chunk = stream.read(8)
        if not isinstance(document, dict):
            raise BadInput(f"{name} describes no scene; {RIGHT}")
        size, kind = struct.unpack("<II", chunk) if len(chunk) == 8 else (0, BINARY_CHUNK)
        begins = 20 + length + 8
        if kind != BINARY_CHUNK or begins + size > path.stat().st_size:
            raise BadInput(f"{name} is not whole: its numbers are missing; {RIGHT}")
        return cls(path, document, begins, size)

    @cached_property
    def rig(self) -> Rig:
        """Nodes in the pose that the file gives them. Raises BadInput for nodes that are no tree."""
        listed = self.document.get("nodes")
        if not isinstance(listed, list) or not 0 < len(listed) <= MOST_LISTED:
            raise BadInput(f"the character has no nodes, or more than {MOST_LISTED}; {RIGHT}")
        try:
            return Rig(tuple(self._bones(listed)))
        except (TypeError, ValueError, KeyError, IndexError, AttributeError) as error:
            raise BadInput(f"the character's nodes are not as glTF has them; {RIGHT}") from error

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Of the nodes, by number; each another."""
        return distinct(str(node.get("name") or "") for node in self.document["nodes"])

    def _bones(self, listed: Sequence[Any]) -> Iterator[RigBone]:
        parents = {child: number for number, node in enumerate(listed) for child in node.get("children", ())}
        waiting = [(number, 0, np.eye(4)) for number in range(len(listed)) if number not in parents]
        seen = 0
        while waiting:
            number, depth, above = waiting.pop()
            seen += 1
            if depth > DEEPEST or seen > len(listed):
                raise ValueError("no tree")
            own = above @ _matrix(listed[number])
            parent = parents.get(number)
            yield RigBone(
                self.names[number], None if parent is None else self.names[parent], tuple(own[:3, 3]),
                axes_of(own),
            )  # fmt: skip
            waiting += [(child, depth + 1, own) for child in listed[number].get("children", ())]

    def write_hands(self, motions: Sequence[HandMotion], hands: Sequence[MovingHand], path: Path) -> None:
        document = json.loads(json.dumps(self.document))
        numbers = BinaryNumbers(
            document.setdefault("accessors", []), document.setdefault("bufferViews", []),
            self.length + -self.length % 4,
        )  # fmt: skip
        time_s = motions[0].time_s - motions[0].time_s[0]
        times = numbers.add(FLOAT, "SCALAR", time_s, low=[0.0], high=[float(np.float32(time_s[-1]))])
        channels, samplers, planned = [], [], []
        for hand in hands:
            rooms = [numbers.room(FLOAT, "VEC4", len(time_s)) for _ in hand.names]
            for name, room in zip(hand.names, rooms, strict=True):
                number = self.names.index(name)
                _make_turnable(document["nodes"][number])
                target = {"node": number, "path": "rotation"}
                channels.append({"sampler": len(samplers), "target": target})
                samplers.append({"input": times, "output": room, "interpolation": "LINEAR"})
            planned.append((hand, rooms))
        extras = notes_of(motions) | {
            "glovecal": {SIDES[motion.label].lower(): channels_of(motion, numbers) for motion in motions}
        }
        animation = {"name": NAME, "channels": channels, "samplers": samplers, "extras": extras}
        document.setdefault("animations", []).append(animation)
        buffers = document.setdefault("buffers", [{}])
        buffers[0]["byteLength"] = numbers.length
        with path.open("wb") as stream:
            begin = write_container(stream, document, numbers)
            stream.seek(begin)
            with self.path.open("rb") as file:
                file.seek(self.begins)
                shutil.copyfileobj(_Part(file, self.length), stream)
            numbers.write(stream, begin)
            for hand, rooms in planned:
                for which, quaternions in continuous_quaternions(hand.turns()):
                    for bone, room in enumerate(rooms):
                        numbers.write_at(stream, begin, room, which.start, quaternions[:, bone])


class _Part:
    """So many bytes of a file, to be copied."""

    def __init__(self, stream: Any, length: int) -> None:
        self._stream, self._left = stream, length

    def read(self, size: int = -1) -> bytes:
        content = self._stream.read(self._left if size < 0 else min(size, self._left))
        self._left -= len(content)
        return content


def _matrix(node: Any) -> np.ndarray:
    if "matrix" in node:
        return np.array(node["matrix"], dtype=float).reshape(4, 4).T
    from scipy.spatial.transform import Rotation  # slow to load, and every command that exports loads this

    matrix = np.eye(4)
    quaternion = np.array(node.get("rotation", (0, 0, 0, 1)), dtype=float)
    turned = Rotation.from_quat(quaternion).as_matrix()
    matrix[:3, :3] = turned * np.array(node.get("scale", (1, 1, 1)), dtype=float)
    matrix[:3, 3] = np.array(node.get("translation", (0, 0, 0)), dtype=float)
    return matrix


def _make_turnable(node: dict[str, Any]) -> None:
    """A node that is given as a matrix cannot be animated: its place and size are told apart from its turn,
    which the animation gives."""
    if "matrix" in node:
        matrix = _matrix(node)
        del node["matrix"]
        node["translation"] = matrix[:3, 3].tolist()
        node["scale"] = np.linalg.norm(matrix[:3, :3], axis=0).tolist()
