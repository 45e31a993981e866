"""IK solves per second of touching hands beside mink, on one core, in alternating runs.

    python tests/bench/inverse_kinematics_bench.py [--quick | --smoke] [--json FILE]

Motions of 176 frames, the length of the paper's, in which the tips of thumb and index, middle or ring finger
stay together; the shape is off by a few degrees. Both stop at the same distance and the same stillness.
Where mink is not installed that is said, and ours runs alone.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from glovecal_models.hand.rotations import FINGERS
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.sampling.inverse_kinematics.contact import TipChains, Touch
from glovecal_models.sampling.inverse_kinematics.follow import STILL_DEG, TIP_TOLERANCE_MM, HandShape, follow
from glovecal_models.simulation.simulated_hand import DRIVEN, ROTATIONS, SimulatedHand
from glovecal_models.simulation.touching import touching_segment
from glovecal_models.worker_processes import pin_blas_to_one_thread

FRAMES, RATE_HZ = 176, 60.0
OFF_DEG = 5.0


def main() -> int:
    parser = argparse.ArgumentParser(description="Inverse kinematics beside mink")
    parser.add_argument("--quick", action="store_true", help="3 runs each instead of 15")
    parser.add_argument("--smoke", action="store_true", help="one motion, once: seconds")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    pin_blas_to_one_thread()
    print(f"{FRAMES} frames, IK solves per second (median); {', '.join(map(_named, ('mink', 'daqp')))}")
    runs = 1 if options.smoke else 3 if options.quick else 15
    rows = [compared(finger, runs) for finger in ("I" if options.smoke else "IMR")]
    for row in rows:
        print(_sentence(row))
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))
    return 0


def compared(finger: str, runs: int) -> dict[str, Any]:
    """One motion; ``ratio`` above 1: ours is quicker. Without mink only our figures."""
    skeleton = hand_skeleton()
    chains, shape = TipChains(skeleton, ("T", finger)), moving_shape(finger)
    answers: dict[str, np.ndarray] = {}

    def ours() -> None:
        answers["glovecal"] = follow(chains, Touch(("T", finger)), shape).angles_deg

    contestants: list[Callable[[], None]] = [ours]
    if _installed("mink"):
        from mink_hand import MinkHand

        mink_hand = MinkHand(skeleton, ("T", finger))

        def mink() -> None:
            answers["mink"] = mink_hand.follow(shape, TIP_TOLERANCE_MM, STILL_DEG)

        contestants.append(mink)
    times = np.array([[_seconds(work) for work in contestants] for _ in range(runs)])
    hz = FRAMES / np.array([statistics.median(column) for column in times.T])
    row: dict[str, Any] = {"finger": finger}
    for name, speed in zip(answers, hz, strict=True):
        apart = np.diff(chains.tips_mm(answers[name]), axis=1)[:, 0]
        row |= {f"{name}_hz": float(speed), f"{name}_mm": float(np.linalg.norm(apart, axis=1).max())}
    if "mink" in answers:
        row["ratio"] = row["glovecal_hz"] / row["mink_hz"]
        row["apart_deg"] = float(np.abs(answers["glovecal"] - answers["mink"]).max())
    return row


def _sentence(row: dict[str, Any]) -> str:
    ours = f"Glovecal {row['glovecal_hz']:.0f} (tips within {row['glovecal_mm']:.4f} mm)"
    beside = ""
    if "ratio" in row:
        beside = (
            f", mink {row['mink_hz']:.0f} ({row['mink_mm']:.4f} mm), ratio {row['ratio']:.2f}; "
            f"angles differ by at most {row['apart_deg']:.3f} degrees"
        )
    return f"  thumb and {FINGERS[row['finger']]}: {ours}{beside}"


def _installed(package: str) -> bool:
    try:
        version(package)
    except PackageNotFoundError:
        return False
    return True


def _named(package: str) -> str:
    return f"{package} {version(package)}" if _installed(package) else f"{package} is not installed"


def moving_shape(finger: str) -> HandShape:
    """A hand that touches, seen through errors that change slowly."""
    skeleton, hand = hand_skeleton(), SimulatedHand(0)
    chains = TipChains(skeleton, ("T", finger))
    time_s = np.arange(FRAMES) / RATE_HZ
    driven = touching_segment(hand, skeleton, finger, seed=1).driven(time_s)
    whole = hand.complete(dict(zip(DRIVEN, driven.T, strict=True)))
    true = whole[:, [ROTATIONS.index(name) for name in chains.rotations]]
    off = OFF_DEG * np.sin(np.arange(true.shape[1]) + 2 * time_s[:, None])
    sd = np.random.default_rng(0).uniform(1.5, 8.0, true.shape[1])
    return HandShape(chains.rotations, true + off, np.tile(sd, (FRAMES, 1)))


def _seconds(work: Callable[[], None]) -> float:
    begun = time.process_time()
    work()
    return time.process_time() - begun


if __name__ == "__main__":
    raise SystemExit(main())
