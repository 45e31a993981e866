"""A character as an animation tool exports it: a rig of another program, both hands, in one file."""

from __future__ import annotations

import json
import struct
import sys
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parents[2] / "models" / "retargeting"))

from rigs import CONVENTIONS, rig_like

from glovecal_models.hand.rotations import HANDS


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
