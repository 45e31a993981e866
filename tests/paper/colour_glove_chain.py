"""Wang & Popovic 2009 from photograph to pose: errors of each stage on hands held out, with their truth.

The paper had none: it shows depth errors in a picture (Figure 12) and tells of five to ten centimetres.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
from colour_glove_scene import HANDS, Scene, cameras, exposed, held_out_states, reprojection_px

from glovecal_models.colour_glove.hand_state import STAGES, HandState
from glovecal_models.progress import Report

FRAMES, QUICK_FRAMES = 100, 4
MOVING_EVERY = 3
_WITHIN = 1.96


@dataclass(frozen=True)
class ChainRow:
    """Of one stage; means over frames, and of joints over their 20 rotations."""

    cameras: int
    hand: str
    stage: str
    frames: int
    lost: int
    """Frames without an answer: they are in no mean."""
    joint_mae_deg: float
    orientation_deg: float
    depth_mm: float
    aside_mm: float
    reprojection_px: float
    coverage: float
    """Share of joints inside the interval that is to hold 95 %."""
    accepted: float
    accepted_rms_deg: float
    accepted_coverage: float
    image_ms: float
    """Processor time of the classifier, per picture."""
    pose_ms: float
    """Of everything after it, per frame."""


@dataclass(frozen=True)
class DepthRow:
    """One frame of the dense refinement."""

    cameras: int
    hand: str
    distance_mm: float
    depth_error_mm: float


def chain(count: int, seed: int, quick: bool, report: Report) -> Mapping[str, Sequence[ChainRow | DepthRow]]:
    """With ``count`` cameras."""
    cv2.setNumThreads(1)
    rows: list[ChainRow] = []
    depths: list[DepthRow] = []
    with TemporaryDirectory(prefix="glovecal-paper-") as folder:
        scene = Scene(Path(folder), quick, report)
        for number, whose in enumerate(HANDS):
            seen = _Seen.taken(scene, count, whose, QUICK_FRAMES if quick else FRAMES, seed)
            for place, stage in enumerate(STAGES[1:]):
                row, errors = _row(scene, seen, stage)
                rows.append(row)
                depths += errors if stage == STAGES[-1] else []
                report(f"tracking {whose} hand", 0.5 + 0.25 * number + 0.08 * (place + 1))
    return {"chain": rows, "depth": depths}


@dataclass(frozen=True, eq=False)
class _Seen:
    cameras: int
    hand: str
    states: list[HandState]
    labels: list[list[np.ndarray]]
    seeds: list[int]
    image_ms: float

    @classmethod
    def taken(cls, scene: Scene, count: int, whose: str, frames: int, seed: int) -> _Seen:
        states = held_out_states(scene.hand.skin, frames)
        speed, views = scene.tracker(count, "ik").errors.speed, cameras(count)
        labels, seeds, rng = [], [], np.random.default_rng([seed, 12])
        scene.colours.labels(np.zeros((480, 640, 3), np.uint8))
        spent = 0.0
        for index, state in enumerate(states):
            seeds.append(10_000 * (seed + 4) + index)
            begin, end = (state, None) if index % MOVING_EVERY else exposed(state, speed, rng)
            pictures = scene.photographs(scene.skin(whose, seeds[-1]), views, begin, end, seeds[-1])
            began = time.process_time()
            labels.append([scene.colours.labels(picture) for picture in pictures])
            spent += time.process_time() - began
        return cls(count, whose, states, labels, seeds, 1e3 * spent / (len(states) * count))


def _row(scene: Scene, seen: _Seen, stage: str) -> tuple[ChainRow, list[DepthRow]]:
    tracker, camera = scene.tracker(seen.cameras, stage), cameras(1)[0]
    tracker.track(seen.labels[0], -1.0)
    errors, deviations, accepted, pixels, depths, spent, lost = [], [], [], [], [], 0.0, 0
    for index, (state, labels) in enumerate(zip(seen.states, seen.labels, strict=True)):
        began = time.process_time()
        found = tracker.track(labels, float(index))
        spent += time.process_time() - began
        if found is None:
            lost += 1
            continue
        step, skin = state.step_from(found.state), scene.skin(seen.hand, seen.seeds[index])
        errors.append(step)
        deviations.append(found.standard_deviation)
        accepted.append(found.accepted)
        pixels.append(reprojection_px(camera, skin, state, scene.hand.skin, found.state))
        distance, error = float(state.position_mm[2]), float(abs(step[25]))
        depths.append(DepthRow(seen.cameras, seen.hand, distance, error))
    error, sure = np.abs(np.array(errors)), np.array(accepted)
    within = error[:, :20] <= _WITHIN * np.array(deviations)[:, :20]
    row = ChainRow(
        seen.cameras, seen.hand, stage, len(seen.states), lost,
        joint_mae_deg=float(error[:, :20].mean()),
        orientation_deg=float(np.linalg.norm(error[:, 20:23], axis=1).mean()),
        depth_mm=float(error[:, 25].mean()),
        aside_mm=float(np.linalg.norm(error[:, 23:25], axis=1).mean()),
        reprojection_px=float(np.mean(pixels)),
        coverage=float(within.mean()),
        accepted=float(sure.mean()),
        accepted_rms_deg=float(np.sqrt((error[:, :20][sure] ** 2).mean())) if sure.any() else float("nan"),
        accepted_coverage=float(within[sure].mean()) if sure.any() else float("nan"),
        image_ms=seen.image_ms,
        pose_ms=1e3 * spent / len(seen.states),
    )  # fmt: skip
    return row, depths
