"""Runs where Blender's own module is: imports files, and drives armatures by live gloves.

``try_blender.py`` begins it and judges what it saw. Of Glovecal there is what the extension brings.
"""

from __future__ import annotations

import importlib
import json
import resource
import sys
import time
from pathlib import Path
from typing import Any

import bpy  # pyright: ignore[reportMissingImports]

M_TO_MM = 1000.0
PATIENCE_S = 60.0
TICK_S = 1 / 60


def empty_scene(rate_hz: float) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps, bpy.context.scene.render.fps_base = round(rate_hz), 1.0


def places(armature: Any) -> dict[str, list[float]]:
    """Head of every bone in mm, and its tail, of the posed armature in the world."""
    posed = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
    found = {}
    for bone in posed.pose.bones:
        for name, place in ((bone.name, bone.head), (f"{bone.name} tail", bone.tail)):
            found[name] = [M_TO_MM * each for each in posed.matrix_world @ place]
    return found


def imported(
    path: Path, importer: str, frames: list[int], rate_hz: float
) -> dict[int, dict[str, list[float]]]:
    empty_scene(rate_hz)
    named = str(path)
    match importer:
        case "bvh":
            bpy.ops.import_anim.bvh(filepath=named, global_scale=0.01)
        case "glb":
            bpy.ops.import_scene.gltf(filepath=named)
        case "fbx":
            bpy.ops.import_scene.fbx(filepath=named)
        case "fbx, new":
            bpy.ops.wm.fbx_import(filepath=named)
        case "usda":
            bpy.ops.wm.usd_import(filepath=named)
    armature = next(each for each in bpy.data.objects if each.type == "ARMATURE")
    first = armature.animation_data.action.frame_range[0] if armature.animation_data else 0
    found = {}
    for frame in frames:
        bpy.context.scene.frame_set(round(first) + frame)
        found[frame] = places(armature)
    return found


def wait_for(condition: Any, live: Any, armature: Any, what: str) -> None:
    until = time.monotonic() + PATIENCE_S
    while not condition():
        live.tick(armature)
        if time.monotonic() > until:
            raise SystemExit(
                f"{what} did not come within {PATIENCE_S:.0f} s: {[hand.sentence for hand in live.hands]}"
            )
        time.sleep(TICK_S)


RECORDED_S = 5.0
"""A recording holds its poses; what is measured to grow is the live hand alone."""


def run_live(live: Any, armature: Any, seconds: float) -> list[float]:
    """Milliseconds of each tick on the main thread."""
    spent = []
    following = time.monotonic()
    until = following + seconds
    while following < until:
        began = time.perf_counter()
        live.tick(armature)
        spent.append(1e3 * (time.perf_counter() - began))
        following += TICK_S
        time.sleep(max(0.0, following - time.monotonic()))
    return spent


def curves_of(action: Any) -> list[Any]:
    if hasattr(action, "layers") and len(action.layers):
        return [curve for bag in action.layers[0].strips[0].channelbags for curve in bag.fcurves]
    return list(action.fcurves)


def live_hands(endpoint: str, seconds: float, rate_hz: float) -> dict[str, Any]:
    addon = importlib.import_module("glovecal_blender")
    panel = importlib.import_module("glovecal_blender.panel")
    armatures = importlib.import_module("glovecal_blender.armatures")
    empty_scene(rate_hz)
    addon.register()
    live, scene = panel.LIVE, bpy.context.scene
    settings = scene.glovecal
    settings.endpoint, settings.gloves = endpoint, "right, left"
    bpy.ops.glovecal.connect()
    wait_for(lambda: all(hand.skeleton is not None for hand in live.hands), live, None, "a hand's skeleton")
    bpy.ops.glovecal.make_armature()
    own = settings.armature
    right = live.hands[0]
    wait_for(lambda: right.latest is not None, live, own, "a pose")
    answer: dict[str, Any] = {}
    latest = right.latest
    armatures.turn(own, right.names, latest)
    bpy.context.view_layer.update()
    answer["own hand"] = {"time_ns": latest.time_ns, "places": places(own)}
    bpy.ops.preferences.addon_enable(module="rigify")
    bpy.ops.object.armature_human_metarig_add()
    rig = settings.armature = bpy.context.object
    live.tick(rig)
    wait_for(
        lambda: all(hand.latest is not None for hand in live.hands), live, rig, "both hands on the metarig"
    )
    for hand in live.hands:
        latest = hand.latest
        armatures.turn(rig, hand.names, latest)
        bpy.context.view_layer.update()
        mapping = hand.touches.retargeting.mapping
        answer[f"metarig {hand.glove}"] = {
            "time_ns": latest.time_ns, "places": places(rig), "mapping": mapping,
            "palm": hand.touches.retargeting.palm.tolist(),
        }  # fmt: skip
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    answer["ms a frame"] = run_live(live, rig, seconds)
    answer["grown MB"] = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    bpy.ops.glovecal.record()
    run_live(live, rig, RECORDED_S)
    recorded = [[turns.time_ns for turns in hand.recording] for hand in live.hands]
    bpy.ops.glovecal.stop()
    action = rig.animation_data.action
    curves = curves_of(action)
    answer["recorded ns"] = recorded
    answer["curves"] = len(curves)
    answer["bones"] = [list(hand.names) for hand in live.hands]
    answer["keys"] = {curve.data_path: [point.co[0] for point in curve.keyframe_points] for curve in curves}
    settings.whole_frames = True
    bpy.ops.glovecal.record()
    run_live(live, rig, 1.0)
    bpy.ops.glovecal.stop()
    answer["baked"] = [point.co[0] for point in curves_of(rig.animation_data.action)[0].keyframe_points]
    bpy.ops.glovecal.disconnect()
    addon.unregister()
    return answer


def main(folder: Path, endpoint: str, seconds: float) -> None:
    asked = json.loads((folder / "asked.json").read_text())
    sys.path[:0] = [asked["addon"], asked["wheels"]]
    rate_hz, frames = asked["rate_hz"], asked["frames"]
    answer: dict[str, Any] = {
        importer: imported(folder / f"both.{importer[:4].rstrip(',')}", importer, frames, rate_hz)
        for importer in ("bvh", "glb", "fbx", "fbx, new", "usda")
    }
    answer["live"] = live_hands(endpoint, seconds, rate_hz)
    answer["blender"] = bpy.app.version_string
    (folder / "seen.json").write_text(json.dumps(answer))


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], float(sys.argv[3]))
