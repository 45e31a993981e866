"""``python3 do.py study camera-errors --sizes``: the same scene by sensors of 640 to 3840 pixels.

Each moment of a worn hand (``worn_glove``) is drawn once, 3840 pixels across; every sensor averages what its
pixels cover, and adds blur, noise and JPEG of its own. All are tracked as the product does, averaged down to
its working size. What their angles differ by from those at 640 pixels stands beside what a second picture of
640 pixels, other in nothing but its noise, makes of them. Two cameras; the hand's shape is the one fitted at
640 pixels for all, and then the one fitted at each size.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from lit_glove import averaged, free_motion
from tracked_hands import ORDER, Moments, Study, WornHand, afresh, worn_hand

from glovecal_models.colour_glove.pose.both_ways import followed_both_ways
from glovecal_models.colour_glove.pose.hand_shape_fit import fitted_hand_shape
from glovecal_models.colour_glove.pose.hand_tracker import HandTracker, with_shape
from glovecal_models.errors import BadInput
from glovecal_models.worker_processes import work_off
from glovecal_service.camera.tracking_setup import at_working_size

FIRST_SEED, HANDS = 9300, 2
SENSORS = ((640, 0), (640, 5000), (1280, 0), (1920, 0), (3840, 0))
"""Pixels across, and what is added to a picture's number, which its noise depends on."""
FITTED = (0, 4)
"""Of ``SENSORS``: those in whose pictures the shape is fitted, too."""
FRAMES, FRAMES_HZ = 20, 10.0
TO_FIT, TO_FIT_HZ = 24, 0.3
_FINEST = (3840, 2880)


@dataclass(frozen=True, eq=False)
class Sized:
    """One hand as every sensor saw it: a list of ``SENSORS``."""

    light: str
    right: np.ndarray
    """(S,): share of the glove's pixels with their colour."""
    held: np.ndarray
    """(S, F, 20): degrees; NaN where no hand was found, or no shape. In the shape fitted at 640 pixels."""
    each: np.ndarray
    """In the shape that was fitted at each size."""
    held_accepted: np.ndarray
    each_accepted: np.ndarray
    """(S, F, 20) bool."""
    truth: np.ndarray
    """(F, 20)."""


def sized(study: Study, number: int) -> Sized:
    hand = worn_hand(study, number)
    fine = [replace(room, camera=room.camera.resized(*_FINEST), finer=1) for room in hand.rooms]
    hand = replace(hand, rooms=fine)
    motion = free_motion(FRAMES / FRAMES_HZ, FRAMES_HZ, hand.seed)
    seen, right = _seen(study, hand, motion, 0)
    to_fit, _ = _seen(study, hand, free_motion(TO_FIT / TO_FIT_HZ, TO_FIT_HZ, hand.seed + 400), 1000)
    return compared(study.tracker, hand.light, right, seen, to_fit, motion[0][:, ORDER])


Views = Sequence[Sequence[Sequence[np.ndarray]]]
"""Labels of each moment by each of ``SENSORS`` of each camera."""


def compared(
    tracker: HandTracker, light: str, right: np.ndarray, seen: Views, to_fit: Views, truth: np.ndarray
) -> Sized:
    """Tracked in the shape that is fitted at 640 pixels, and in those fitted at each size."""
    in_shape: list[HandTracker | None] = [None] * len(SENSORS)
    for sensor in FITTED:
        try:
            shape = fitted_hand_shape(tracker, [views[sensor] for views in to_fit]).shape
            in_shape[sensor] = with_shape(tracker, shape)
        except BadInput:  # as where its pictures are too few
            pass
    (held, held_accepted), (each, each_accepted) = (
        map(
            np.array,
            zip(*(_followed(t, [views[s] for views in seen]) for s, t in enumerate(those)), strict=True),
        )
        for those in ([in_shape[0]] * len(SENSORS), in_shape)
    )
    return Sized(light, right, held, each, held_accepted, each_accepted, truth)


def _seen(study: Study, hand: WornHand, moments: Moments, first: int) -> tuple[Views, np.ndarray]:
    """And the share (S,) of the glove that is right."""
    right, every, found = np.zeros(len(SENSORS)), 0, []
    for index, moment in enumerate(zip(*moments, strict=True)):
        by_sensor: list[list[np.ndarray]] = [[] for _ in SENSORS]
        for room in hand.rooms:
            light, truth = room.light_of(*moment)
            share = _FINEST[0] // study.tracker.cameras[0].width
            truth = truth[share // 2 :: share, share // 2 :: share]
            every += int((truth > 0).sum())
            for sensor, (width, other_noise) in enumerate(SENSORS):
                picture = room.developed(averaged(light, width), first + index + other_noise)
                labels = study.colours.labels(at_working_size(picture))
                right[sensor] += int((labels[truth > 0] == truth[truth > 0]).sum())
                by_sensor[sensor].append(labels)
        found.append(by_sensor)
    return found, right / every


def _followed(
    tracker: HandTracker | None, seen: Sequence[Sequence[np.ndarray]]
) -> tuple[np.ndarray, np.ndarray]:
    """Angles (F, 20), degrees, and whether each is accepted."""
    angles = np.full((len(seen), len(ORDER)), np.nan)
    accepted = np.zeros(angles.shape, bool)
    if tracker is None:
        return angles, accepted
    moments = ((labels, index / FRAMES_HZ) for index, labels in enumerate(seen))
    for index, pose in enumerate(followed_both_ways(afresh(tracker), afresh(tracker), moments)):
        if pose is not None:
            angles[index], accepted[index] = pose.state.angles_deg, pose.accepted
    return angles, accepted


def differences(angles: np.ndarray, accepted: np.ndarray, sensor: int) -> np.ndarray:
    """(N,) degrees from those at 640 pixels, of angles (S, F, 20) that both accept."""
    both = accepted[0] & accepted[sensor]
    return (angles[sensor] - angles[0])[both]


def table(hands: Sequence[Sized]) -> str:
    """In Markdown, a row for each sensor."""
    lines = [
        "| | glove pixels right | accepted | differ from 640 pixels, one shape: RMS, median | all angles | "
        "shape fitted at each: RMS, median | error of the accepted |",
        "|---|---|---|---|---|---|---|",
    ]
    for sensor, (width, other_noise) in enumerate(SENSORS):
        right = " / ".join(f"{100 * hand.right[sensor]:.1f}" for hand in hands)
        accepted = np.mean([hand.held_accepted[sensor] for hand in hands])
        held, each = (
            np.concatenate(
                [differences(getattr(hand, way), getattr(hand, f"{way}_accepted"), sensor) for hand in hands]
            )
            for way in ("held", "each")
        )
        every = np.concatenate([(hand.held[sensor] - hand.held[0]).ravel() for hand in hands])
        error = np.concatenate(
            [(hand.held[sensor] - hand.truth)[hand.held_accepted[sensor]] for hand in hands]
        )
        name = f"{width} pixels{', other noise' if other_noise else ''}"
        rms = float(np.sqrt(np.mean(np.square(error))))
        apart = " | ".join(map(_told, (held, every, each)))
        lines.append(f"| {name} | {right} % | {100 * accepted:.0f} % | {apart} | {rms:.1f} |")
    return "\n".join(lines)


def _told(apart: np.ndarray) -> str:
    apart = apart[np.isfinite(apart)]
    if not apart.size:
        return "-"
    return f"{np.sqrt(np.mean(np.square(apart))):.2f}, {np.median(np.abs(apart)):.2f}"


def report(folder: Path, entries: int) -> str:
    study = Study(folder, 2, 0.0, entries, True, FIRST_SEED)
    _ = study.tracker, study.colours  # made once, not in each process
    found: dict[int, Sized] = {}
    work_off(partial(sized, study), range(HANDS), os.cpu_count() or 1, found.__setitem__, "tracking")
    those = [hand for _, hand in sorted(found.items())]
    lights = " / ".join(hand.light for hand in those)
    return f"# The same scene at other sizes: {HANDS} hands ({lights} light), two cameras\n\n{table(those)}\n"
