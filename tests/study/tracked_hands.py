"""Hands that the tracker never saw, tracked: what the study of its errors is made from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from lit_glove import HARD, SOFT, LitGlove, a_light, free_motion, other_camera
from worn_glove import ROTATIONS, WornGlove, family

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.hand_shape import HandShape
from glovecal_models.colour_glove.hand_state import FINGER_ROTATIONS
from glovecal_models.colour_glove.pictures.classify import ColourTable, drawn_colours
from glovecal_models.colour_glove.pose.both_ways import followed_both_ways
from glovecal_models.colour_glove.pose.hand_shape_fit import MOST_PICTURES, fitted_hand_shape
from glovecal_models.colour_glove.pose.hand_tracker import HandTracker, prepared_tracker, with_shape
from glovecal_models.errors import BadInput

RATE_HZ, SECONDS = 30.0, 5.0
FIRST_SEED = 9000
"""What was chosen was chosen on seeds 500 to 599."""
ASIDE_DEG, AROUND_MM = 60.0, 470.0
"""The second camera looks at the same place from the side."""
SHAPE_HZ = 0.5
ORDER = [ROTATIONS.index(name) for name in FINGER_ROTATIONS]
"""Of a worn hand's angles, as a state has them."""


@dataclass(frozen=True, eq=False)
class TrackedHand:
    """One hand's frames (F, 20): degrees, and whether each is accepted."""

    light: str
    frames: np.ndarray
    """(F,) numbers."""
    truth: np.ndarray
    error: np.ndarray
    sd: np.ndarray
    accepted: np.ndarray
    pixels: tuple[int, int]
    """Of the glove: rightly labelled, all."""
    bones: tuple[float, float] | None
    """RMS error of its bones' lengths, relative to the hand's size, and the stated one; None where no shape
    was fitted, or it was refused."""


def cameras(count: int) -> tuple[Camera, ...]:
    angle = np.radians(-ASIDE_DEG)
    turn = np.array(
        [[np.cos(angle), 0.0, np.sin(angle)], [0.0, 1.0, 0.0], [-np.sin(angle), 0.0, np.cos(angle)]]
    )
    around = np.array([0.0, 0.0, AROUND_MM])
    shift = around - turn @ around
    aside = replace(
        other_camera(2),
        rotation=tuple(tuple(map(float, row)) for row in turn),
        translation_mm=(float(shift[0]), float(shift[1]), float(shift[2])),
    )
    return (other_camera(1), aside)[:count]


@dataclass(frozen=True, eq=False)
class Study:
    """What is tracked, and how."""

    folder: Path
    count: int
    seconds: float
    entries: int
    fits_shape: bool
    first_seed: int = FIRST_SEED

    @cached_property
    def tracker(self) -> HandTracker:
        return prepared_tracker(self.folder, cameras(self.count), entries=self.entries)

    @cached_property
    def colours(self) -> ColourTable:
        file = self.folder / "colours.npz"
        if not file.exists():
            drawn_colours(self.tracker.hand.skin, self.tracker.hand.pattern).save(file)
        return ColourTable.load(file)


@dataclass(frozen=True, eq=False)
class WornHand:
    """One hand in its room, before the study's cameras."""

    light: str
    glove: WornGlove
    rooms: Sequence[LitGlove]
    """One for each camera."""
    seed: int


Moments = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Angles (N, 20) in the order of ``ROTATIONS``, the palm's turns (N, 3, 3), wrists (N, 3) mm."""


def worn_hand(study: Study, number: int) -> WornHand:
    seed, light = study.first_seed + number, (SOFT, HARD)[number % 2]
    glove = family(number + 1, study.first_seed)[number]
    rooms = [
        LitGlove(glove, camera, a_light(light, seed), seed + 977 * place)
        for place, camera in enumerate(study.tracker.cameras)
    ]
    return WornHand(light, glove, rooms, seed)


def fitted_tracker(study: Study, hand: WornHand) -> tuple[HandTracker, HandShape | None]:
    """In the shape that 50 moments of 100 s give; where it is refused, as the hand's sizes say."""
    apart = free_motion(MOST_PICTURES / SHAPE_HZ, SHAPE_HZ, hand.seed + 400)
    views = [
        [study.colours.labels(room.picture(*moment, 1000 + index)[0]) for room in hand.rooms]
        for index, moment in enumerate(zip(*apart, strict=True))
    ]
    try:
        shape = fitted_hand_shape(study.tracker, views).shape
    except BadInput:  # the command goes on without
        return study.tracker, None
    return with_shape(study.tracker, shape), shape


def tracked(study: Study, number: int) -> TrackedHand:
    """A hand of its own, followed both ways at stage dense."""
    hand = worn_hand(study, number)
    first, bones = study.tracker, None
    if study.fits_shape:
        first, shape = fitted_tracker(study, hand)
        bones = None if shape is None else _bones_off(shape, hand.glove)
    angles, turns, places = free_motion(study.seconds, RATE_HZ, hand.seed)
    right = [0, 0]

    def moments() -> Iterator[tuple[list[np.ndarray], float]]:
        for index, moment in enumerate(zip(angles, turns, places, strict=True)):
            found = []
            for room in hand.rooms:
                picture, truth = room.picture(*moment, index)
                found.append(study.colours.labels(picture))
                right[0] += int((found[-1][truth > 0] == truth[truth > 0]).sum())
                right[1] += int((truth > 0).sum())
            yield found, index / RATE_HZ

    rows = []
    for frame, pose in enumerate(followed_both_ways(afresh(first), afresh(first), moments())):
        if pose is not None:
            truth = angles[frame][ORDER]
            sd = pose.standard_deviation[: len(truth)]
            rows.append((frame, truth, pose.state.angles_deg - truth, sd, pose.accepted))
    frames, true, errors, deviations, accepted = (np.array(column) for column in zip(*rows, strict=True))
    pixels = right[0], right[1]
    return TrackedHand(hand.light, frames, true, errors, deviations, accepted, pixels, bones)


def afresh(tracker: HandTracker) -> HandTracker:
    """The same one, which has seen nothing yet."""
    return HandTracker(tracker.hand, tracker.lookup, tracker.cameras, tracker.errors)


def _bones_off(shape: HandShape, glove: WornGlove) -> tuple[float, float]:
    names = [name for name in shape.sizes_mm if name.endswith(("proximal", "middle"))]
    off = [shape.sizes_mm[name] / glove.sizes_mm[name] for name in names]
    stated = np.mean([max(0.0, shape.bones_sd[name] ** 2 - shape.size_sd**2) for name in names])
    return float(np.std(off) / np.mean(off)), float(np.sqrt(stated))
