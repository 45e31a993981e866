"""Tries exports and the extension in Blender's own module, headless: ``python3 do.py blender --test``.

An environment of its own holds it (.tools/blender, 0.8 GB, installed once). What Blender shows is held
against the kinematics of the hand.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import threading
import time
import zipfile
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import zenoh
from build_extension import HERE, build
from posed_hands import AGREES_MM, END, RATE_HZ, SIDES, expected, moving

from glovecal_client.clock import clock_ns
from glovecal_client.keys import JSON_ENCODING, GloveKeys
from glovecal_client.session import router_config
from glovecal_client.wire.pose import POSE_ENCODING, Pose, PoseFlag, encode_pose
from glovecal_models.hand.bones import HAND, HandBones
from glovecal_models.hand.retargeting.touches import FAR_MM
from glovecal_models.hand.rotations import FINGERS
from glovecal_models.hand.skeleton import skeleton_document
from glovecal_service.exports.formats import FORMATS
from glovecal_service.exports.hand_motion import HandMotion

ROOT = Path(__file__).resolve().parents[2]
ENVIRONMENT = ROOT / ".tools" / "blender"
FRAMES = [0, 5, 11]
SITE, MODEL = "lab", "ab" * 32
AGREES_DEG = 0.01
FASTEST_BLENDER_MS = 2.0
IMPORTERS = ("bvh", "glb", "fbx", "fbx, new", "usda")


def environment(uv: str) -> Path:
    """The Python that has Blender's module."""
    python = ENVIRONMENT / ("Scripts" if sys.platform == "win32" else "bin") / "python"
    if not (ENVIRONMENT / "ready").exists():
        print("installing Blender's own module into .tools/blender ...", file=sys.stderr)
        subprocess.run(
            [uv, "venv", "--quiet", "--clear", "--python", sys.executable, str(ENVIRONMENT)], check=True
        )
        subprocess.run([uv, "pip", "install", "--quiet", "--python", str(python), "bpy"], check=True)
        (ENVIRONMENT / "ready").touch()
    return python


def in_blender(body: np.ndarray) -> np.ndarray:
    """x to the body's left, y up, z forward, as Blender has it: z up."""
    return np.array([body[0], -body[2], body[1]])


def opened_hand(hand: HandMotion) -> HandMotion:
    """Whose thumb is nowhere near a finger: near a touch joints are turned further on purpose."""
    degrees = np.clip(hand.degrees, 0.0, 40.0)
    for name, angle in {"T_TMC": 0.0, "TI_ABD": 65.0, "T_VIR": 0.0, "T_MCP": 0.0, "T_IP": 0.0}.items():
        degrees[:, hand.rotations.index(name)] = angle
    bones = HandBones.of(hand.skeleton)
    tips = bones.posed(degrees)[1][:, :, 1]
    fingers = [number for number, name in enumerate(bones.names) if name.endswith("_distal")]
    gaps = np.linalg.norm(tips[:, fingers[1:]] - tips[:, fingers[:1]], axis=2)
    assert gaps.min() > FAR_MM, gaps.min()
    return replace(hand, degrees=degrees)


class Gloves(threading.Thread):
    """Two gloves' poses over zenoh, as the service sends them; marked as simulated."""

    def __init__(self, session: zenoh.Session, hands: dict[str, HandMotion]) -> None:
        super().__init__(daemon=True)
        self.hands, self.sent = hands, dict[str, dict[int, int]]()
        self._session, self._over = session, threading.Event()
        self._queryables = []
        for glove, hand in hands.items():
            keys = GloveKeys(SITE, glove)
            document = {"glove": glove, "state": "calibrated", "model": MODEL, "hand": hand.skeleton.hand}
            document |= {"rotations": list(hand.rotations), "skeleton": skeleton_document(hand.skeleton)}

            def answer(
                query: zenoh.Query, meta: str = json.dumps(document), key: str = keys.pose_meta
            ) -> None:
                query.reply(key, meta, encoding=JSON_ENCODING)

            self._queryables.append(session.declare_queryable(keys.pose_meta, answer))
            self.sent[glove] = {}

    def run(self) -> None:
        number = 0
        following = time.monotonic()
        while not self._over.is_set():
            for glove, hand in self.hands.items():
                frame, now = number % len(hand.time_s), clock_ns()
                self.sent[glove][now] = frame
                pose = Pose(
                    number, 1, now, time.time_ns(), hand.degrees[frame].astype("<f4"),
                    hand.sd_deg[frame].astype("<f4"), np.zeros(len(hand.rotations), np.uint8), MODEL,
                    int(PoseFlag.SIMULATED),
                )  # fmt: skip
                self._session.put(GloveKeys(SITE, glove).pose, encode_pose(pose), encoding=POSE_ENCODING)
            number += 1
            following += 1 / RATE_HZ
            time.sleep(max(0.0, following - time.monotonic()))

    def close(self) -> None:
        self._over.set()
        self.join()


def judge_imports(seen: dict[str, Any], hands: dict[str, HandMotion]) -> list[tuple[str, float, float]]:
    rows = []
    for importer in IMPORTERS:
        worst = 0.0
        for frame in FRAMES:
            places = {name: np.array(place) for name, place in seen[importer][str(frame)].items()}
            for hand in hands.values():
                side = SIDES[hand.label]
                for name, place in expected(hand, frame).items():
                    bone = name if name in places else f"{name.removesuffix(END)} tail"
                    away = places[bone] - places[f"{side}Hand"] - in_blender(place)
                    worst = max(worst, float(np.abs(away).max()))
        rows.append((f"{importer}: joints and fingertips of both hands, mm", worst, AGREES_MM))
    return rows


def judge_live(live: dict[str, Any], gloves: Gloves) -> list[tuple[str, float, float]]:
    own, hand = live["own hand"], gloves.hands["right"]
    bones = HandBones.of(hand.skeleton)
    frame = gloves.sent["right"][own["time_ns"]]
    heads = bones.posed(hand.degrees[[frame]].astype("<f4").astype(float))[1][0]
    places = {name: np.array(place) for name, place in own["places"].items()}
    worst = max(
        float(np.abs(places[f"{name}.R{end}"] - heads[number, part]).max())
        for number, name in enumerate(bones.names)
        for part, end in ((0, ""), (1, " tail"))
    )
    rows = [("live, the subject's own hand: joints and fingertips, mm", worst, AGREES_MM)]
    for glove, hand in gloves.hands.items():
        told = live[f"metarig {glove}"]
        bones, palm = HandBones.of(hand.skeleton), np.array(told["palm"])
        frame = gloves.sent[glove][told["time_ns"]]
        axes = bones.orientations(hand.degrees[[frame]].astype("<f4").astype(float))[0]
        places = {name: np.array(place) for name, place in told["places"].items()}
        worst = 0.0
        for name, bone in told["mapping"].items():
            if name == HAND or name.startswith(FINGERS["T"]):
                continue
            along = places[f"{bone} tail"] - places[bone]
            wanted = palm @ axes[bones.names.index(name), :, 0]
            cosine = along @ wanted / np.linalg.norm(along)
            sine = np.linalg.norm(np.cross(along, wanted)) / np.linalg.norm(along)
            worst = max(worst, float(np.degrees(np.arctan2(sine, cosine))))
        rows.append(
            (
                f"live, the human metarig's {hand.skeleton.hand} fingers point as the hand's, degrees",
                worst,
                AGREES_DEG,
            )
        )
    for names, times in zip(live["bones"], live["recorded ns"], strict=True):
        path = next(path for path in live["keys"] if f'"{names[0]}"' in path)
        keys = np.array(live["keys"][path])
        own_s = (np.array(times) - times[0]) * 1e-9
        worst_ms = 1e3 * float(np.abs((keys - keys[0]) / RATE_HZ - own_s).max())
        rows.append(("recorded: key frames against the poses' own times, ms", worst_ms, 0.05))
    baked = np.array(live["baked"])
    rows.append(
        ("baked: key frames away from whole frames", float(np.abs(baked - np.round(baked)).max()), 0.0)
    )
    spent = np.array(live["ms a frame"])
    rows.append(
        (
            "a frame of two hands on the main thread, ms (p99)",
            float(np.percentile(spent, 99)),
            FASTEST_BLENDER_MS,
        )
    )
    rows.append(("grown while it ran, MB", live["grown MB"], 20.0))
    return rows


def main() -> int:
    parser = argparse.ArgumentParser(prog="python3 do.py blender --test", description=__doc__)
    parser.add_argument("--uv", default="uv")
    parser.add_argument("--pip", default=sys.executable)
    parser.add_argument("--seconds", type=float, default=10.0, help="of live hands; 600 for ten minutes")
    asked = parser.parse_args()
    python = environment(asked.uv)
    hands = {"right": moving("R"), "left": moving("L")}
    open_hands = {name: opened_hand(hand) for name, hand in hands.items()}
    with tempfile.TemporaryDirectory(prefix="glovecal-in-blender-") as temporary, ExitStack() as opened:
        folder = Path(temporary)
        for suffix in (".bvh", ".glb", ".fbx", ".usda"):
            FORMATS[suffix].write(list(hands.values()), "joints", folder / f"both{suffix}")
        made = build(asked.pip, HERE, folder)
        addon, wheels = folder / "addon" / "glovecal_blender", folder / "wheels"
        with zipfile.ZipFile(made) as archive:
            archive.extractall(addon)
        install = [
            asked.uv,
            "pip",
            "install",
            "--quiet",
            "--no-deps",
            "--python",
            str(python),
            "--target",
            str(wheels),
        ]
        subprocess.run([*install, *map(str, (addon / "wheels").glob("*.whl"))], check=True)
        checker = next(ENVIRONMENT.rglob("bl_pkg/cli/blender_ext.py"))
        subprocess.run(
            [str(python), str(checker), "validate", str(made)], check=True, stdout=subprocess.DEVNULL
        )
        (folder / "asked.json").write_text(
            json.dumps(
                {"rate_hz": RATE_HZ, "frames": FRAMES, "addon": str(addon.parent), "wheels": str(wheels)}
            )
        )
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        session = opened.enter_context(zenoh.open(router_config([endpoint])))
        gloves = Gloves(session, open_hands)
        gloves.start()
        opened.callback(gloves.close)
        script = Path(__file__).with_name("in_blender.py")
        log = folder / "log"
        with log.open("wb") as stream:
            code = subprocess.run(
                [str(python), "-I", str(script), str(folder), endpoint, str(asked.seconds)],
                stdout=stream,
                stderr=stream,
            ).returncode
        if code:
            print(log.read_text(errors="replace")[-4000:], file=sys.stderr)
            return 1
        seen = json.loads((folder / "seen.json").read_text())
        rows = judge_imports(seen, hands) + judge_live(seen["live"], gloves)
    print(f"Blender {seen['blender']}, headless; hands are simulated\n")
    print("| what | seen | at most |\n|---|---|---|")
    for what, value, limit in rows:
        print(f"| {what} | {value:.2g}{'' if value <= limit else ' **too much**'} | {limit:g} |")
    return int(any(value > limit for _, value, limit in rows))


def free_port() -> int:
    import socket

    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


if __name__ == "__main__":
    sys.exit(main())
