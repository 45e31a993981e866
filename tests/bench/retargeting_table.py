"""Fingertips and lost touches on other skeletons and on robots' hands: ``python3 do.py bench retargeting``.

Skeletons like those of five programs are made up (``tests/models/retargeting/rigs.py``)."""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "models" / "retargeting"))

from rigs import CONVENTIONS, rig_like

from glovecal_models.hand.retargeting.retarget import Retargeting
from glovecal_models.hand.retargeting.robot import RobotHand, known_robots
from glovecal_models.hand.retargeting.robot_retarget import RobotRetargeting
from glovecal_models.hand.retargeting.touches import TOUCHING_MM, Touches
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG, HANDS, known_hand
from glovecal_models.hand.skeleton import hand_skeleton

POSES, DRAWN, SEED, LOST_MM, LIVE = 500, 20_000, 11, 10.0, 100


def _robot(name: str, drawn: np.ndarray) -> dict[str, float]:
    hand = known_hand(name.rpartition("_")[2])
    made = RobotRetargeting(hand_skeleton(hand=hand or "right"), RobotHand.known(name))
    own = made.own_joints_mm(drawn)

    def gaps(joints: np.ndarray) -> np.ndarray:
        return np.linalg.norm(joints[:, 1:, -1] - joints[:, :1, -1], axis=2)

    closed = gaps(own) < TOUCHING_MM
    near = np.flatnonzero(closed.any(axis=1))[:POSES]
    shown = made.shown_joints_mm(drawn[:POSES])
    rms = float(np.sqrt((np.linalg.norm(own[:POSES, :, -1] - shown[:, :, -1], axis=2) ** 2).mean()))
    steps = [np.diff(each, axis=2) for each in (own[:POSES], shown)]
    lengths = np.prod([np.linalg.norm(each, axis=3) for each in steps], axis=0)
    cosine = (steps[0] * steps[1]).sum(axis=3) / lengths
    degrees = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    lost = closed[near] & (gaps(made.shown_joints_mm(drawn[near])) > gaps(own[near]) + LOST_MM)
    before = made.radians(drawn[:1])[0]
    began = time.perf_counter()
    for pose in drawn[:LIVE]:
        before = made.radians(pose[None], before)[0]
    live_ms = 1e3 * (time.perf_counter() - began) / LIVE
    fingers, thumb = float(np.median(degrees[:, 1:])), float(np.median(degrees[:, 0]))
    print(
        f"| {name.replace('_', ', ')} | {rms:.1f} | {fingers:.1f}; {thumb:.1f} | {lost.any(axis=1).sum()} of "
        f"{len(near)} | {live_ms:.1f} |"
    )
    return {
        "fingertip_rms_mm": rms,
        "fingers_deg": fingers,
        "thumb_deg": thumb,
        "lost": int(lost.any(axis=1).sum()),
        "touches": len(near),
        "live_ms": live_ms,
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--json", type=Path)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--smoke", action="store_true")
    options = parser.parse_args()
    drawn_poses = 2_000 if options.smoke or options.quick else DRAWN
    found = {}
    low, high = np.array([ACTIVE_RANGE_DEG[name] for name in hand_skeleton().rotations]).T
    drawn = np.random.default_rng(SEED).uniform(low, high, (drawn_poses, len(low)))
    print("| like | fingertips, mm | touches lost without, with keeping them |\n|---|---|---|")
    for name, convention in CONVENTIONS.items():
        away, counts = [], np.zeros(3, int)
        for hand in HANDS:
            touches = Touches(Retargeting.of(hand_skeleton(hand=hand), rig_like(convention, hand)))
            thumb = list(touches.chains).index("thumb")

            def gaps(joints: np.ndarray, thumb: int = thumb) -> np.ndarray:
                tips = joints[:, :, -1]
                return np.linalg.norm(np.delete(tips - tips[:, [thumb]], thumb, axis=1), axis=2)

            own = touches.own_joints_mm(drawn)
            near = np.flatnonzero((gaps(own) < TOUCHING_MM).any(axis=1))[:POSES]
            free = np.arange(POSES)
            shown = touches.joints(touches.orientations(drawn[free])) / touches.units_a_mm
            away.append(np.linalg.norm(own[free, :, -1] - shown[:, :, -1], axis=2).reshape(-1))
            turned = (touches.retargeting.orientations(drawn[near]), touches.orientations(drawn[near]))
            closed = gaps(own[near]) < TOUCHING_MM
            counts[0] += len(near)
            for place, orientations in enumerate(turned, 1):
                other = gaps(touches.joints(orientations) / touches.units_a_mm)
                counts[place] += (closed & (other > gaps(own[near]) + LOST_MM)).any(axis=1).sum()
        rms = float(np.sqrt((np.concatenate(away) ** 2).mean()))
        found[name] = {"fingertip_rms_mm": rms, "touches": counts.tolist()}
        print(f"| {name} | {rms:.1f} | {counts[1]}, {counts[2]} of {counts[0]} |")
    print("\n| robot | fingertips, mm | bones, degrees (median; thumb) | touches lost | ms a frame, live |")
    print("|---|---|---|---|---|")
    for name in known_robots():
        found[name] = _robot(name, drawn)
    if options.json is not None:
        options.json.write_text(json.dumps(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
