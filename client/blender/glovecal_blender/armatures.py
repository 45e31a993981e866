"""Armatures: read as a rig in its rest pose, made of a subject's hand, turned, and written as an action."""

from __future__ import annotations

from collections.abc import Sequence

import bpy  # pyright: ignore[reportMissingImports]
import numpy as np
from mathutils import Vector  # pyright: ignore[reportMissingImports]

from glovecal_models.errors import BadInput
from glovecal_models.hand.bones import HandBones
from glovecal_models.hand.retargeting.rig import Rig, RigBone
from glovecal_models.hand.skeleton import Skeleton

from .live_hand import BoneTurns

MM_PER_UNIT = 1000.0
SD_PROPERTY = "glovecal_sd_deg"
GOOD, BAD = "THEME03", "THEME01"
"""Colours of bones: green while the pose can be used, red while it cannot."""
FOREARM_MM = 120.0


def rig_of(armature: bpy.types.Object) -> Rig:
    """In the armature's own space."""
    bones: list[RigBone] = []

    def go(bone: bpy.types.Bone) -> None:
        axes = np.array(bone.matrix_local.to_3x3())
        bones.append(
            RigBone(
                bone.name, None if bone.parent is None else bone.parent.name, tuple(bone.head_local),
                axes / np.linalg.norm(axes, axis=0), tuple(bone.tail_local),
            )
        )  # fmt: skip
        for child in bone.children:
            go(child)

    for bone in armature.data.bones:
        if bone.parent is None:
            go(bone)
    return Rig(tuple(bones))


def make_hand(context: bpy.types.Context, skeleton: Skeleton) -> bpy.types.Object:
    """An armature of the subject's own hand: palm down, fingers straight, along x; metres."""
    side = "L" if skeleton.hand == "left" else "R"
    data = bpy.data.armatures.new(f"Glovecal hand {side}")
    made = bpy.data.objects.new(data.name, data)
    context.collection.objects.link(made)
    context.view_layer.objects.active = made
    bpy.ops.object.mode_set(mode="EDIT")
    forearm = data.edit_bones.new(f"forearm.{side}")
    forearm.head, forearm.tail = (-FOREARM_MM / MM_PER_UNIT, 0.0, 0.0), (0.0, 0.0, 0.0)
    bones = HandBones.of(skeleton)
    frames, places = bones.posed(np.zeros((1, len(skeleton.rotations))))
    ends = places[0] / MM_PER_UNIT
    added = []
    for number, (name, parent) in enumerate(zip(bones.names, bones.parents, strict=True)):
        bone = data.edit_bones.new(f"{name}.{side}")
        bone.head, bone.tail = ends[number]
        bone.align_roll(Vector(frames[0, number, :, 2]))
        bone.parent = forearm if parent is None else added[parent]
        added.append(bone)
    bpy.ops.object.mode_set(mode="OBJECT")
    return made


def require_armature(armature: bpy.types.Object | None) -> bpy.types.Object:
    """Raises BadInput."""
    if armature is None or armature.type != "ARMATURE":
        raise BadInput("no armature is chosen; choose one, or make one of the subject's hand")
    return armature


def turn(armature: bpy.types.Object, names: Sequence[str], turns: BoneTurns) -> None:
    """The newest pose onto the bones: colour says whether it can be used, a property how certain it is."""
    parts = (turns.quaternions, turns.sd_deg, turns.usable)
    for name, quaternion, sd_deg, is_usable in zip(names, *(part.tolist() for part in parts), strict=True):
        colour = GOOD if is_usable else BAD
        bone = armature.pose.bones[name]
        if bone.rotation_mode != "QUATERNION":
            bone.rotation_mode = "QUATERNION"
        bone.rotation_quaternion = quaternion
        if sd_deg == sd_deg:
            bone[SD_PROPERTY] = sd_deg
        if bone.color.palette != colour:
            bone.color.palette = colour


def write_action(
    armature: bpy.types.Object,
    names: Sequence[str],
    recorded: Sequence[BoneTurns],
    begin: float,
    action: bpy.types.Action,
) -> None:
    """Key frames at the poses' own times from frame ``begin`` on, which need not be whole frames; of the last
    run, if capture was started anew."""
    last = [turns for turns in recorded if turns.run == recorded[-1].run]
    scene = bpy.context.scene
    rate = scene.render.fps / scene.render.fps_base
    frames = begin + np.array([turns.time_ns - last[0].time_ns for turns in last]) * 1e-9 * rate
    values = continuous(np.array([turns.quaternions for turns in last]))
    for bone, name in enumerate(names):
        path = f'pose.bones["{bpy.utils.escape_identifier(name)}"].rotation_quaternion'
        for part in range(4):
            _write_curve(armature, action, path, part, frames, values[:, bone, part])


def baked(recorded: Sequence[BoneTurns], rate_hz: float) -> list[BoneTurns]:
    """On whole frames: of the two poses around each, what lies between them."""
    last = [turns for turns in recorded if turns.run == recorded[-1].run]
    times = np.array([turns.time_ns for turns in last], dtype=float)
    values = continuous(np.array([turns.quaternions for turns in last]))
    at = np.arange(times[0], times[-1] + 0.5, 1e9 / rate_hz)
    after = np.clip(np.searchsorted(times, at), 1, max(len(times) - 1, 1))
    if len(times) < 2:
        return list(last)
    share = np.clip((at - times[after - 1]) / (times[after] - times[after - 1]), 0, 1)[:, None, None]
    mixed = _between(values[after - 1], values[after], share)
    return [
        BoneTurns(
            round(time), last[-1].run, mixed[number], last[after[number]].sd_deg, last[after[number]].usable
        )
        for number, time in enumerate(at)
    ]


def continuous(values: np.ndarray) -> np.ndarray:
    """(N, M, 4): of a turn's two quaternions the one nearer to that of the frame before."""
    dots = (values[1:] * values[:-1]).sum(axis=2)
    signs = np.cumprod(np.where(dots < 0, -1.0, 1.0), axis=0)
    return np.concatenate([values[:1], values[1:] * signs[:, :, None]])


def _between(first: np.ndarray, second: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Spherical interpolation."""
    cosine = np.clip((first * second).sum(axis=2, keepdims=True), -1, 1)
    angle = np.arccos(cosine)
    small = angle < 1e-6
    sine = np.where(small, 1.0, np.sin(angle))
    a = np.where(small, 1 - share, np.sin((1 - share) * angle) / sine)
    b = np.where(small, share, np.sin(share * angle) / sine)
    mixed = a * first + b * second
    return mixed / np.linalg.norm(mixed, axis=2, keepdims=True)


def _write_curve(
    armature: bpy.types.Object,
    action: bpy.types.Action,
    path: str,
    part: int,
    frames: np.ndarray,
    values: np.ndarray,
) -> None:
    if hasattr(action, "fcurve_ensure_for_datablock"):  # since Blender 4.4 an action has slots
        curve = action.fcurve_ensure_for_datablock(armature, path, index=part)
    else:
        curve = action.fcurves.find(path, index=part) or action.fcurves.new(path, index=part)
    curve.keyframe_points.clear()
    curve.keyframe_points.add(len(frames))
    curve.keyframe_points.foreach_set("co", np.column_stack([frames, values]).reshape(-1))
    linear = bpy.types.Keyframe.bl_rna.properties["interpolation"].enum_items["LINEAR"].value
    curve.keyframe_points.foreach_set("interpolation", np.full(len(frames), linear, np.int32))
    curve.update()
