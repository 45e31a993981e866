"""USD as text (.usda): a UsdSkel skeleton and its animation, with standard deviations and flags beside it;
centimetres.

Text needs no library, and programs turn it into their own binary form. Time samples stand at the frames' own
times.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TextIO

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
from glovecal_service.exports.hand_motion import (
    ALL_CHANNELS,
    Channel,
    Content,
    ExportFormat,
    HandMotion,
    blocks,
)

MM_PER_UNIT = 10.0
HEAD = """#usda 1.0
(
    customLayerData = {{
        string glovecal = {notes}
    }}
    defaultPrim = "Hands"
    startTimeCode = 0
    endTimeCode = {end!r}
    framesPerSecond = {rate!r}
    timeCodesPerSecond = {rate!r}
    metersPerUnit = 0.01
    upAxis = "Y"
)

def SkelRoot "Hands" (
    prepend apiSchemas = ["SkelBindingAPI"]
)
{{
    def Skeleton "Skeleton" (
        prepend apiSchemas = ["SkelBindingAPI"]
    )
    {{
        uniform token[] joints = [{joints}]
        uniform matrix4d[] bindTransforms = [{bind}]
        uniform matrix4d[] restTransforms = [{rest}]
        rel skel:animationSource = </Hands/Skeleton/Animation>

        def SkelAnimation "Animation"
        {{
            uniform token[] joints = [{moving}]
            float3[] translations = [{translations}]
            half3[] scales = [{scales}]
            quatf[] rotations.timeSamples = {{
"""
ROTATIONS = """\
            custom uniform token[] glovecal:{side}:rotations = [{names}]
"""
CHANNEL = """\
            custom {kind}[] glovecal:{side}:{key}.timeSamples = {{
"""
SAMPLES_END = "            }\n"
FOOT = """\
        }}
    }}

    def Mesh "Bones" (
        prepend apiSchemas = ["SkelBindingAPI"]
    )
    {{
        uniform token subdivisionScheme = "none"
        rel skel:skeleton = </Hands/Skeleton>
        point3f[] points = [{points}]
        int[] faceVertexCounts = [{counts}]
        int[] faceVertexIndices = [{faces}]
        matrix4d primvars:skel:geomBindTransform = ((1,0,0,0), (0,1,0,0), (0,0,1,0), (0,0,0,1))
        int[] primvars:skel:jointIndices = [{indices}] (
            elementSize = 1
            interpolation = "vertex"
        )
        float[] primvars:skel:jointWeights = [{weights}] (
            elementSize = 1
            interpolation = "vertex"
        )
    }}
}}
"""


def write_usd(motions: Sequence[HandMotion], content: Content, path: Path) -> None:
    """Hands on one time, on one body. Raises BadInput for raw readings."""
    body = BodyMotion.of(motions, content, FORMAT.suffix)
    bones = with_ends(body.bones)
    paths = _paths(bones)
    time_s = body.time_s - body.time_s[0]
    rate = float(1 / np.median(np.diff(time_s))) if len(time_s) > 1 else 1.0
    codes = time_s * rate
    by_name = {bone.name: bone for bone in bones}
    moving = [by_name[name].offset_mm for name in body.moving]
    points, faces, carriers = drawn_bones(bones)
    with path.open("w", encoding="utf-8", newline="\n") as stream:
        stream.write(
            HEAD.format(
                notes=json.dumps(json.dumps(body.notes)), end=float(codes[-1]), rate=rate,
                joints=_quoted(paths.values()), moving=_quoted(paths[name] for name in body.moving),
                bind=_shifts(heads_mm(bones).values()), rest=_shifts(bone.offset_mm for bone in bones),
                translations=_tuples(np.array(moving) / MM_PER_UNIT),
                scales=", ".join(["(1, 1, 1)"] * len(moving)),
            )
        )  # fmt: skip
        turn = "({:.9g}, {:.9g}, {:.9g}, {:.9g})"
        line = f"                {{!r}}: [{', '.join([turn] * len(moving))}],\n"
        for which, quaternions in continuous_quaternions(body.turns()):
            rows = np.roll(quaternions, 1, axis=2).reshape(len(quaternions), -1).tolist()
            stream.writelines(
                line.format(code, *row) for code, row in zip(codes[which].tolist(), rows, strict=True)
            )
        stream.write(SAMPLES_END)
        for motion in motions:
            side = SIDES[motion.label].lower()
            stream.write(ROTATIONS.format(side=side, names=_quoted(motion.rotations)))
            for channel in motion.channels:
                kind = "int" if channel.is_held else "float"
                stream.write(CHANNEL.format(kind=kind, side=side, key=channel.key))
                _write_channel(stream, codes, channel)
        stream.write(
            FOOT.format(
                points=_tuples(points / MM_PER_UNIT), counts=", ".join(["3"] * len(faces)),
                faces=", ".join(map(str, faces.reshape(-1).tolist())),
                indices=", ".join(map(str, carriers)), weights=", ".join(["1"] * len(carriers)),
            )
        )  # fmt: skip


def _write_channel(stream: TextIO, codes: np.ndarray, channel: Channel) -> None:
    numbers = channel.numbers
    for which in blocks(len(codes)):
        rows = zip(codes[which].tolist(), numbers[which].tolist(), strict=True)
        stream.writelines(
            f"                {code!r}: [{', '.join(f'{value:.6g}' for value in row)}],\n"
            for code, row in rows
        )
    stream.write(SAMPLES_END)


def _paths(bones: Sequence[Bone]) -> dict[str, str]:
    """A joint's name in USD says on what it hangs."""
    paths: dict[str, str] = {}
    for bone in bones:
        paths[bone.name] = bone.name if bone.parent is None else f"{paths[bone.parent]}/{bone.name}"
    return paths


def _quoted(names: Iterable[str]) -> str:
    return ", ".join(f'"{name}"' for name in names)


def _tuples(rows: np.ndarray) -> str:
    return ", ".join(f"({x:.9g}, {y:.9g}, {z:.9g})" for x, y, z in rows.tolist())


def _shifts(offsets_mm: Iterable[Sequence[float] | np.ndarray]) -> str:
    """Matrices without a turn; rows are what columns are elsewhere."""
    matrices = []
    for offset in offsets_mm:
        x, y, z = (float(length) / MM_PER_UNIT for length in offset)
        matrices.append(f"((1,0,0,0), (0,1,0,0), (0,0,1,0), ({x!r}, {y!r}, {z!r}, 1))")
    return ", ".join(matrices)


FORMAT = ExportFormat(
    ".usda", "model/vnd.usda", write_usd, SKELETAL, "USD (UsdSkel) as text",
    unit="cm", axes=BODY_AXES, times="the frames' own", accuracy=ALL_CHANNELS,
    read_by="Houdini, Omniverse, Blender, Maya, Unreal",
)  # fmt: skip
