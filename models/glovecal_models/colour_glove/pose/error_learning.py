"""Learn the tracker's errors on rendered hands that are not the model's: other bones, radii and sizes.

The paper learns R, Q and P on a recorded sequence about local averages of its own answers (section 5.3);
rendered hands have a truth, and errors that last are errors too. All is learned on drawn photographs, with an
arm, a face and a room, whose colours are classified. Kept beside the database: the same hand, database and
cameras are learned once.

A tracker for one hand and its cameras, from what is kept in a folder; the first time it is built there.
"""

from __future__ import annotations

import hashlib
import math
import os
from collections import defaultdict
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.database import ENTRIES, DatabaseSettings, pose_database
from glovecal_models.colour_glove.hand_state import DEGREES_OF_FREEDOM, STAGES, HandState
from glovecal_models.colour_glove.lookup import PoseLookup, pca_code
from glovecal_models.colour_glove.pattern import printed_pattern
from glovecal_models.colour_glove.photograph import (
    CONE_DEG,
    Photographer,
    Photography,
    hand_motion,
    labelled_photographs,
)
from glovecal_models.colour_glove.pictures.classify import ColourTable
from glovecal_models.colour_glove.pictures.white_balance import Gains
from glovecal_models.colour_glove.pose.hand_tracker import (
    HandTracker,
    LearnedErrors,
    fitted_scale,
    scale_name,
)
from glovecal_models.colour_glove.pose.window_view import PrintedHand
from glovecal_models.colour_glove.pose_set import PAPER_COUNT, generated_poses
from glovecal_models.colour_glove.rasterise import rasterise
from glovecal_models.colour_glove.skin import RADII_MM, HandSkin, hand_skin, posed
from glovecal_models.errors import BadInput
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.progress import Cancel, Report, part
from glovecal_models.worker_processes import work_off

CLIPS = 24
"""Each with a hand of its own."""
_APART, _CLOSE = (20, 1.5), (24, 30.0)
"""States of a clip and how many a second: nearly independent, and a sequence."""
_WRONG, _CLUTTER = 0.04, 3
"""Share of wrong glove pixels, and little blobs of glove colour beside the hand."""
_EXPOSURE_S = 0.01
_FORMAT = 3
_LEAST_PIXELS = 400


@dataclass(frozen=True)
class ShapeSpread:
    """Relative standard deviations of hands about their model; by default those between people."""

    bones: float = 0.045
    radii: float = 0.05
    overall: float = 0.02

    @classmethod
    def after_fit(cls, size_sd: float, bones_sd: Collection[float]) -> ShapeSpread:
        """What a fitted shape leaves open; ``bones_sd`` hold the size's share, radii gain as bones do."""
        bones = math.sqrt(max(0.0, sum(sd**2 for sd in bones_sd) / len(bones_sd) - size_sd**2))
        return cls(bones, bones * cls.radii / cls.bones, size_sd)


PEOPLE = ShapeSpread()
"""Of hands whose shape was not fitted."""


def other_hand(skin: HandSkin, seed: int, spread: ShapeSpread = PEOPLE) -> HandSkin:
    """A hand like ``skin``'s but for its bones, radii and size: what a model of this hand may be wrong by."""
    rng = np.random.default_rng([seed, 3])
    sizes, grown = skin.skeleton.dimensions.sizes_mm, 1.0 + spread.overall * rng.standard_normal()
    whole = ("hand_length", "hand_breadth")
    changed = {
        name: float(size * grown * (1.0 if name in whole else 1.0 + spread.bones * rng.standard_normal()))
        for name, size in sizes.items()
    }
    skeleton = hand_skeleton(HandDimensions.from_measured(changed), skin.skeleton.hand)
    share = skeleton.dimensions.hand_length_mm / hand_skin().skeleton.dimensions.hand_length_mm
    thicker = {name: 1.0 + spread.radii * rng.standard_normal() for name in RADII_MM}
    return hand_skin(
        skeleton,
        {
            name: (low * share * thicker[name], high * share * thicker[name])
            for name, (low, high) in RADII_MM.items()
        },
    )


def spoilt(labels: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Labels with some pixels wrong and some clutter, as from a classifier."""
    found, glove = labels.copy(), labels > 0
    wrong = glove & (rng.random(labels.shape) < _WRONG)
    count = int(wrong.sum())
    found[wrong] = np.where(rng.random(count) < 0.7, 0, rng.integers(1, 11, count))
    for _ in range(_CLUTTER):
        v, u, size = rng.integers(0, labels.shape[0]), rng.integers(0, labels.shape[1]), rng.integers(1, 6)
        blob = found[v : v + size, u : u + size]
        blob[blob == 0] = rng.integers(1, 11)
    return found


def drawn_colours(hand: PrintedHand, light: Gains | None = None) -> ColourTable:
    """The table of colours learned from drawn photographs of this hand before the camera assumed.

    ``light``: gains that correct it; the photographs are taken in it, uncorrected. What a strong light cuts
    off at the end of a channel no gain brings back, but the table learns how the colours look so.
    """
    cast = (1.0, 1.0, 1.0) if light is None else (1 / light.red, 1 / light.green, 1 / light.blue)
    examples = labelled_photographs(hand.skin, hand.pattern, Camera(), gains=cast)
    return ColourTable.trained([each.picture for each in examples], [each.labels for each in examples])


def learned_errors(
    hand: PrintedHand,
    lookup: PoseLookup,
    cameras: Sequence[Camera],
    *,
    spread: ShapeSpread = PEOPLE,
    clips: int = CLIPS,
    workers: int | None = None,
    report: Report | None = None,
    cancelled: Cancel | None = None,
) -> LearnedErrors:
    """Those of this hand, database and cameras: loaded from beside the database, or learned and kept there.
    ``spread``: how far the hand that is seen may be from the model.

    Raises BadInput, Cancelled.
    """
    file = errors_file(hand, lookup, cameras, clips, spread)
    if file.exists():
        try:
            return LearnedErrors.load(file)
        except BadInput:
            file.unlink()
    said = part(report, 0.0, 0.25)
    scene = _Scene(hand, cameras, spread, drawn_colours(hand))
    job = partial(_blend_errors, scene, lookup)
    steps = _over_clips(job, clips, workers, said, cancelled)
    blends = np.concatenate(steps)
    covariance = blends.T @ blends / len(blends) + np.eye(DEGREES_OF_FREEDOM)
    speed = _speed(hand.skin, clips)
    first = LearnedErrors.as_posterior(covariance, speed)
    said = part(report, 0.25, 0.6)
    job = partial(_errors, scene, lookup, first, STAGES, False)
    alone = _over_clips(job, clips, workers, said, cancelled)
    scales = {}
    for stage in STAGES:
        scales[stage] = fitted_scale(*_joined(alone, stage))
    first = replace(
        first,
        scales={**first.scales}
        | scales
        | {scale_name(stage, True): scales[stage] for stage in ("ik", "dense")},
    )
    said = part(report, 0.6, 1.0)
    # A followed answer differs from one alone only while a hand is followed: half the clips tell enough.
    job = partial(_errors, scene, lookup, first, ("ik", "dense"), True)
    followed = _over_clips(job, -(-clips // 2), workers, said, cancelled)
    for stage in ("ik", "dense"):
        scales[scale_name(stage, True)] = fitted_scale(*_joined(followed, stage))
    found = LearnedErrors(covariance, speed, scales)
    unfinished = file.with_suffix(f".{os.getpid()}")
    found.save(unfinished)
    unfinished.replace(file)
    return found


def errors_file(
    hand: PrintedHand,
    lookup: PoseLookup,
    cameras: Sequence[Camera],
    clips: int,
    spread: ShapeSpread = PEOPLE,
) -> Path:
    """Where they are kept: beside the database, named after what they were learned with."""
    name = (_FORMAT, clips, lookup.database.folder.name, tuple(cameras), spread)
    found = hashlib.sha256(repr(name).encode())
    for array in (hand.skin.vertices_mm, hand.pattern.colour_of_patch):
        found.update(np.ascontiguousarray(array).tobytes())
    return lookup.database.folder / f"errors-{found.hexdigest()[:20]}.npz"


def _over_clips(
    job, clips: int, workers: int | None, report: Report | None, cancelled: Cancel | None
) -> list:  # type: ignore[no-untyped-def, type-arg]
    workers = min(workers or os.cpu_count() or 1, clips)
    found: dict[int, object] = {}

    def take(clip: int, errors: object) -> None:
        found[clip] = errors
        if report:
            report("learning errors", len(found) / clips)

    work_off(job, range(clips), workers, take, "learning the tracker's errors", cancelled)
    return [found[clip] for clip in range(clips)]


@dataclass(frozen=True, eq=False)
class _Clip:
    states: list[HandState]
    pictures: list[list[np.ndarray]]
    seconds: np.ndarray


@dataclass(frozen=True, eq=False)
class _Scene:
    """What is photographed: a hand of its own in every clip, not farther than ``spread`` from the model's."""

    hand: PrintedHand
    cameras: Sequence[Camera]
    spread: ShapeSpread
    colours: ColourTable


def _clip(scene: _Scene, seed: int, frames: int, rate_hz: float, cone_deg: float = CONE_DEG) -> _Clip:
    """Photographs, their colours classified."""
    hand, cameras = scene.hand, scene.cameras
    other, rng = other_hand(hand.skin, seed, scene.spread), np.random.default_rng([seed, 4])
    seconds = np.arange(frames) / rate_hz
    states = hand_motion(other, frames / rate_hz, rate_hz, seed=seed, cone_deg=cone_deg)[:frames]
    look = Photography(exposure=float(rng.uniform(0.8, 1.1)), arm=("skin", "sleeve")[seed % 2])
    rooms = [
        Photographer(other, hand.pattern, camera, look, seed + number * 1_000_000)
        for number, camera in enumerate(cameras)
    ]
    pictures = []
    for index, state in enumerate(states):
        placed = posed(other, state)
        drawn = [
            rasterise(placed, other.triangles, camera).painted(hand.pattern.colour) for camera in cameras
        ]
        if sum(np.count_nonzero(labels) for labels in drawn) < _LEAST_PIXELS:
            pictures.append(None)
            continue
        until = _at_the_end_of_exposure(states, index, rate_hz)
        taken = [room.photograph(state, until, number=index).picture for room in rooms]
        pictures.append([scene.colours.labels(picture) for picture in taken])
    kept = [index for index, views in enumerate(pictures) if views is not None]
    return _Clip([states[i] for i in kept], [pictures[i] for i in kept], seconds[kept])


def _at_the_end_of_exposure(states: Sequence[HandState], index: int, rate_hz: float) -> HandState | None:
    """None in clips of few pictures a second: between two of them nobody knows the way."""
    if rate_hz < _CLOSE[1] or index + 1 == len(states):
        return None
    return states[index].moved(_EXPOSURE_S * rate_hz * states[index + 1].step_from(states[index]))


def _blend_errors(scene: _Scene, lookup: PoseLookup, clip: int) -> np.ndarray:
    """(N, 26), of hands turned as far as the database's are."""
    plain = LearnedErrors.as_posterior(np.eye(DEGREES_OF_FREEDOM), np.ones(DEGREES_OF_FREEDOM))
    scene = replace(scene, cameras=scene.cameras[:1])
    tracker = HandTracker(scene.hand, lookup, scene.cameras, plain, stage="blend")
    frames, cone_deg = (2 * _APART[0], _APART[1]), DatabaseSettings().cone_deg
    made = _clip(scene, 1000 + clip, *frames, cone_deg)
    steps = []
    for state, views in zip(made.states, made.pictures, strict=True):
        glimpse = tracker.glimpse(views[0], scene.cameras[0])
        if glimpse is not None:
            steps.append(state.step_from(glimpse.blend.state))
    return np.array(steps).reshape(-1, DEGREES_OF_FREEDOM)


_Errors = dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]


def _errors(
    scene: _Scene, lookup: PoseLookup, errors: LearnedErrors, stages: Sequence[str], follows: bool, clip: int
) -> _Errors:
    """Per stage: errors (N, 26), posterior deviations (N, 26), disagreeing shares (N,)."""
    made, found = _clip(scene, 2000 + clip, *(_CLOSE if follows else _APART)), {}
    for stage in stages:
        tracker = HandTracker(scene.hand, lookup, scene.cameras, errors, stage=stage, follows=follows)
        rows = defaultdict(list)
        for state, views, seconds in zip(made.states, made.pictures, made.seconds, strict=True):
            answer = tracker.answered(views, float(seconds))
            if answer is None or answer.followed != follows:
                continue
            rows["error"].append(state.step_from(answer.state))
            rows["posterior"].append(answer.posterior_sd)
            rows["disagreeing"].append(answer.disagreeing)
        found[stage] = (
            np.array(rows["error"]).reshape(-1, DEGREES_OF_FREEDOM),
            np.array(rows["posterior"]).reshape(-1, DEGREES_OF_FREEDOM),
            np.array(rows["disagreeing"]),
        )
    return found


def _joined(found: Sequence[_Errors], stage: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    errors, posterior, disagreeing = (
        np.concatenate([clip[stage][part] for clip in found]) for part in range(3)
    )
    return errors, posterior, disagreeing


def _speed(skin: HandSkin, clips: int) -> np.ndarray:
    steps = []
    for clip in range(clips):
        states = hand_motion(skin, _CLOSE[0] / _CLOSE[1], _CLOSE[1], seed=3000 + clip)
        steps += [later.step_from(before) for before, later in pairwise(states)]
    return np.sqrt(np.square(steps).mean(axis=0)) * _CLOSE[1]


def prepared_tracker(
    folder: Path,
    cameras: Sequence[Camera] = (Camera(),),
    *,
    hand: PrintedHand | None = None,
    spread: ShapeSpread = PEOPLE,
    entries: int = ENTRIES,
    clips: int = CLIPS,
    report: Report | None = None,
    cancelled: Cancel | None = None,
) -> HandTracker:
    """``hand``: the hand to be seen, in its glove; without one the assumed right hand in the glove that
    ``glovecal camera sheets`` prints. ``spread``: how far the hand may be from that.

    The database takes about half a minute on two cores, what is learned of its errors a minute; afterwards
    both are read. Raises BadInput, Cancelled.
    """
    hand = PrintedHand(hand_skin(), printed_pattern()) if hand is None else hand
    database = pose_database(
        hand.skin, hand.pattern, generated_poses(PAPER_COUNT), folder, DatabaseSettings(entries=entries),
        report=part(report, 0.0, 0.3), cancelled=cancelled,
    )  # fmt: skip
    lookup = PoseLookup(database, pca_code(database.transforms))
    errors = learned_errors(
        hand, lookup, cameras, spread=spread, clips=clips, report=part(report, 0.3, 1.0), cancelled=cancelled
    )
    return HandTracker(hand, lookup, cameras, errors)
