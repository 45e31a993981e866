"""BVH (Biovision hierarchy), text that nearly every animation tool reads: centimetres, three turns a bone.

A file has one frame time: frames stand on even steps.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TextIO

import numpy as np

from glovecal_service.exports.body_motion import BODY_AXES, SKELETAL, BodyMotion, Bone, even_steps
from glovecal_service.exports.hand_motion import NO_ROOM, Content, ExportFormat, HandMotion, at_times

MM_PER_UNIT = 10.0
STEP_DIGITS = 9
"""Of the frame time, seconds."""
ORDER = "ZXY"
"""Of a bone's three turns. The middle one, about the finger's length, stays far from 90 degrees."""


def write_bvh(motions: Sequence[HandMotion], content: Content, path: Path) -> None:
    """Hands on one time, on one body. Raises BadInput for raw readings, for one frame, and for too many."""
    time_s, step_s = even_steps(motions[0].time_s, STEP_DIGITS)
    body = BodyMotion.of([at_times(motion, time_s) for motion in motions], content, FORMAT.suffix)
    with path.open("w", encoding="ascii", newline="\n") as stream:
        order = _write_hierarchy(stream, body.bones)
        stream.write(f"MOTION\nFrames: {len(time_s)}\nFrame Time: {step_s:.{STEP_DIGITS}f}\n")
        line = _line(body, order)
        places = [body.moving.index(name) for name in order if name in body.moving]
        for _, turns in body.turns():
            stream.writelines(_rows(line, turns[:, places]))


def _write_hierarchy(stream: TextIO, bones: Sequence[Bone]) -> list[str]:
    """The names of the bones in the order of their channels."""
    children: dict[str | None, list[Bone]] = {}
    for bone in bones:
        children.setdefault(bone.parent, []).append(bone)
    order: list[str] = []
    lines = ["HIERARCHY"]

    def offset(values: tuple[float, float, float]) -> str:
        return "OFFSET " + " ".join(f"{value / MM_PER_UNIT:.6f}" for value in values)

    def write(bone: Bone, depth: int) -> None:
        tab, is_root = "\t" * depth, bone.parent is None
        places = "Xposition Yposition Zposition " if is_root else ""
        count = 6 if is_root else 3
        rotations = " ".join(f"{axis}rotation" for axis in ORDER)
        order.append(bone.name)
        lines.extend([f"{tab}{'ROOT' if is_root else 'JOINT'} {bone.name}", f"{tab}{{"])
        # The root's place is in its channels, where readers differ in whether they add the offset to it.
        at = replace(bone, offset_mm=(0.0, 0.0, 0.0)) if is_root else bone
        lines.append(f"{tab}\t{offset(at.offset_mm)}")
        lines.append(f"{tab}\tCHANNELS {count} {places}{rotations}")
        for child in children.get(bone.name, []):
            write(child, depth + 1)
        if bone.end_mm is not None:
            lines.extend([f"{tab}\tEnd Site", f"{tab}\t{{", f"{tab}\t\t{offset(bone.end_mm)}", f"{tab}\t}}"])
        lines.append(f"{tab}}}")

    write(children[None][0], 0)
    stream.write("\n".join(lines) + "\n")
    return order


def _line(body: BodyMotion, order: Sequence[str]) -> str:
    """A frame's line, with a place for each turn that moves; the others are written already."""
    root = " ".join(f"{value / MM_PER_UNIT:.6f}" for value in body.bones[0].offset_mm)
    still, turned = " ".join(["0.000000"] * 3), " ".join(["%.6f"] * 3)
    return " ".join([root, *(turned if name in body.moving else still for name in order)]) + "\n"


def _rows(line: str, turns: np.ndarray) -> Iterator[str]:
    """Lines of n frames; ``turns``: (n, B, 3, 3)."""
    from scipy.spatial.transform import Rotation  # slow to load, and every command that exports loads this

    count, bones = turns.shape[:2]
    angles = Rotation.from_matrix(turns.reshape(-1, 3, 3)).as_euler(ORDER, degrees=True)
    for row in (angles.reshape(count, 3 * bones) + 0.0).tolist():
        yield line % tuple(row)


FORMAT = ExportFormat(
    ".bvh", "application/octet-stream", write_bvh, SKELETAL, "BVH",
    unit="cm", axes=BODY_AXES, times="even steps", accuracy=NO_ROOM,
    read_by="Blender, MotionBuilder, Maya, iClone and nearly all others",
)  # fmt: skip
