"""Figure 11 of Wang & Popovic 2009 and what it lacks, the error: each term of the tracker on sequences.

A pose that follows the one before may be smooth and wrong; so no jitter stands here without its error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from colour_glove_scene import EXPOSURE_S, HANDS, Scene, cameras, reprojection_px

from glovecal_models.colour_glove.hand_state import FINGER_ROTATIONS, HandState
from glovecal_models.colour_glove.photograph import Photographer, Photography, hand_motion
from glovecal_models.colour_glove.pose_set import hand_shapes
from glovecal_models.colour_glove.skin import HandSkin
from glovecal_models.progress import Report

SEQUENCES = ("rigid", "open and close", "finger by finger", "medley")
METHODS = (("blend", False), ("ik", False), ("ik", True), ("dense", False), ("dense", True))
RATE_HZ, LENGTH_S, QUICK_S = 30.0, 5.0, 0.5
_AROUND = 2
"""Frames on each side of one: the five of the paper's local average."""
_CYCLE_S = 1.25


@dataclass(frozen=True)
class MotionRow:
    """One sequence by one method, one camera; means over its frames."""

    sequence: str
    hand: str
    stage: str
    follows: bool
    frames: int
    joint_mae_deg: float
    depth_mm: float
    reprojection_px: float
    jitter_deg: float
    """Root mean square deviation of joints from the average of five frames."""
    jitter_mm: float
    """The same of the palm's depth."""
    true_jitter_deg: float
    true_jitter_mm: float
    """Of the motion itself."""


def motion(seed: int, quick: bool, report: Report) -> Mapping[str, Sequence[MotionRow]]:
    rows: list[MotionRow] = []
    with TemporaryDirectory(prefix="glovecal-paper-") as folder:
        scene = Scene(Path(folder), quick, report)
        for number, (sequence, whose) in enumerate((name, whose) for name in SEQUENCES for whose in HANDS):
            report(f"tracking {sequence}, {whose} hand", 0.5 + 0.5 * number / (len(SEQUENCES) * len(HANDS)))
            film = _Film.taken(scene, sequence, whose, QUICK_S if quick else LENGTH_S, 60_000 * seed + number)
            rows += [_row(scene, film, stage, follows) for stage, follows in METHODS]
    return {"motion": rows}


@dataclass(frozen=True, eq=False)
class _Film:
    sequence: str
    hand: str
    skin: HandSkin
    states: list[HandState]
    labels: list[np.ndarray]

    @classmethod
    def taken(cls, scene: Scene, sequence: str, whose: str, seconds: float, seed: int) -> _Film:
        """By one camera; the hand moves on while each picture is exposed."""
        states, skin = sequence_states(scene.hand.skin, sequence, seconds, seed), scene.skin(whose, seed)
        look = Photography(arm=("skin", "sleeve")[seed % 2])
        room = Photographer(skin, scene.hand.pattern, cameras(1)[0], look, seed)
        labels = []
        for number, (here, after) in enumerate(pairwise(states)):
            until = here.moved(EXPOSURE_S * RATE_HZ * after.step_from(here))
            labels.append(scene.colours.labels(room.photograph(here, until, number=number).picture))
        return cls(sequence, whose, skin, states[:-1], labels)


def _row(scene: Scene, film: _Film, stage: str, follows: bool) -> MotionRow:
    tracker, (camera,), model = scene.tracker(1, stage, follows=follows), cameras(1), scene.hand.skin
    steps, pixels, found, true = [], [], [], []
    for number, (state, labels) in enumerate(zip(film.states, film.labels, strict=True)):
        pose = tracker.track([labels], number / RATE_HZ)
        if pose is None:
            continue
        steps.append(np.abs(state.step_from(pose.state)))
        pixels.append(reprojection_px(camera, film.skin, state, model, pose.state))
        found.append(np.append(pose.state.angles_deg, pose.state.position_mm[2]))
        true.append(np.append(state.angles_deg, state.position_mm[2]))
    errors, jitter, own = np.array(steps), _jitter(np.array(found)), _jitter(np.array(true))
    return MotionRow(
        film.sequence, film.hand, stage, follows, len(steps),
        joint_mae_deg=float(errors[:, :20].mean()),
        depth_mm=float(errors[:, 25].mean()),
        reprojection_px=float(np.mean(pixels)),
        jitter_deg=jitter[0],
        jitter_mm=jitter[1],
        true_jitter_deg=own[0],
        true_jitter_mm=own[1],
    )  # fmt: skip


def _jitter(values: np.ndarray) -> tuple[float, float]:
    """RMS deviation from the average of five frames: of the joints (degrees), of the depth (mm)."""
    wide = 2 * _AROUND + 1
    averages = np.lib.stride_tricks.sliding_window_view(values, wide, axis=0).mean(axis=-1)
    square = (values[_AROUND : len(values) - _AROUND] - averages) ** 2
    return float(np.sqrt(square[:, :-1].mean())), float(np.sqrt(square[:, -1].mean()))


def sequence_states(skin: HandSkin, sequence: str, seconds: float, seed: int) -> list[HandState]:
    """At 30 Hz; the palm moves as in ``hand_motion``, the fingers as the sequence's name says."""
    moving = hand_motion(skin, seconds, RATE_HZ, seed=seed)
    if sequence == "medley":
        return moving
    fingers = _fingers(sequence, np.arange(len(moving)) / RATE_HZ)
    return [
        HandState(bend, state.rotation, state.position_mm)
        for bend, state in zip(fingers, moving, strict=True)
    ]


def _fingers(sequence: str, times: np.ndarray) -> np.ndarray:
    """(N, 20)."""
    shapes = hand_shapes()
    opened, closed = shapes["5"], shapes["S"]
    if sequence == "rigid":
        return np.tile(shapes["B"], (len(times), 1))
    share = 0.5 - 0.5 * np.cos(2 * np.pi * times / _CYCLE_S)
    if sequence == "open and close":
        return opened + share[:, None] * (closed - opened)
    turn, found = (times / _CYCLE_S).astype(int) % 4, np.tile(opened, (len(times), 1))
    for number, finger in enumerate("IMRP"):
        now = np.flatnonzero(turn == number)
        own = np.flatnonzero([name.startswith(f"{finger}_") for name in FINGER_ROTATIONS])
        found[np.ix_(now, own)] += share[now, None] * (closed - opened)[own]
    return found
