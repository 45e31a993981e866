"""Learn the tracker's errors on drawn hands and gloves that are not the model's.

The paper learns R, Q and P on a recorded sequence about local averages of its own answers (section 5.3);
drawn hands have a truth, and errors that last are errors too. All is learned on drawn photographs, with an
arm, a face and a room, in many lights, whose colours are classified; each clip has a hand, a glove that lies
its own way, lenses and places of cameras of its own. It takes half an hour, so what was learned comes with
the package (``errors.npz``; ``python3 do.py study camera-errors --learn`` makes it).
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np
from other_gloves import displaced, other_hand

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.database import DatabaseSettings
from glovecal_models.colour_glove.hand_state import DEGREES_OF_FREEDOM, FINGER_ROTATIONS, STAGES, HandState
from glovecal_models.colour_glove.lookup import PoseLookup
from glovecal_models.colour_glove.photograph import (
    CONE_DEG,
    Photographer,
    hand_motion,
    some_light,
)
from glovecal_models.colour_glove.pictures.classify import ColourTable, drawn_colours
from glovecal_models.colour_glove.pose.hand_shape_fit import MOST_PICTURES, fitted_hand_shape
from glovecal_models.colour_glove.pose.hand_tracker import (
    EVIDENCE,
    HandTracker,
    LearnedErrors,
    fitted_scale,
    scale_name,
)
from glovecal_models.colour_glove.pose.window_view import PrintedHand
from glovecal_models.colour_glove.rasterise import rasterise
from glovecal_models.colour_glove.skin import HandSkin, posed
from glovecal_models.errors import BadInput
from glovecal_models.progress import Cancel, Report, part
from glovecal_models.worker_processes import work_off

CLIPS, FITTED_CLIPS = 48, 12
"""Each with a hand of its own; of those whose shape is fitted first, which takes a minute each."""
_APART, _CLOSE = (20, 1.5), (24, 30.0)
"""States of a clip and how many a second: nearly independent, and a sequence."""
_EXPOSURE_S = 0.01
_FOCAL_PX, _ASIDE_DEG, _MEETING_MM = (480.0, 680.0), (35.0, 90.0), 470.0
"""Of the drawn cameras: focal lengths at 640 pixels, how far aside the second stands, where both look."""
_SHAPE_PICTURES = (MOST_PICTURES, 0.5)
"""From which a shape is fitted: how many, and how many a second."""
_LEAST_PIXELS = 400


def learned_errors(
    hand: PrintedHand,
    lookup: PoseLookup,
    cameras: int,
    *,
    clips: int = CLIPS,
    workers: int | None = None,
    report: Report | None = None,
    cancelled: Cancel | None = None,
) -> LearnedErrors:
    """Of ``cameras`` (1 or 2) that see this hand. Raises Cancelled."""
    scene = _Scene(hand, cameras, drawn_colours(hand.skin, hand.pattern))
    job = partial(_blend_errors, scene, lookup)
    steps = _over_clips(job, clips, workers, part(report, 0.0, 0.2), cancelled)
    blends = np.concatenate(steps)
    covariance = blends.T @ blends / len(blends) + np.eye(DEGREES_OF_FREEDOM)
    first = LearnedErrors.as_posterior(covariance, _speed(hand.skin, clips))
    job = partial(_errors, scene, lookup, first, STAGES, False)
    alone = _over_clips(job, clips, workers, part(report, 0.2, 0.6), cancelled)
    scales = {stage: fitted_scale(*_joined(alone, stage)) for stage in STAGES}
    followed = {scale_name(stage, True): scales[stage] for stage in ("ik", "dense")}
    first = replace(first, scales={**first.scales} | scales | followed)
    # A followed answer differs from one alone only while a hand is followed: half the clips tell enough.
    job = partial(_errors, scene, lookup, first, ("ik", "dense"), True)
    following = _over_clips(job, -(-clips // 2), workers, part(report, 0.6, 1.0), cancelled)
    for stage in ("ik", "dense"):
        scales[scale_name(stage, True)] = fitted_scale(*_joined(following, stage))
    return replace(first, scales=scales)


def learned_on_fitted_hands(
    hand: PrintedHand, lookup: PoseLookup, cameras: int, errors: LearnedErrors, *, clips: int = FITTED_CLIPS
) -> LearnedErrors:
    """As ``errors``, but of hands whose shape was fitted: what the fit leaves. The fingers' joints of one
    kind count together, as so few hands tell little of each."""
    scene = _Scene(hand, cameras, drawn_colours(hand.skin, hand.pattern))
    found = _over_clips(partial(_errors_when_fitted, scene, lookup, errors), clips, None, None, None)
    kinds = [name.rpartition("_")[2] for name in FINGER_ROTATIONS] + ["turn"] * 3 + ["place"] * 3
    scales = {}
    for name in found[0]:
        off, evidence = _joined(found, name)
        whole = np.empty((DEGREES_OF_FREEDOM, len(EVIDENCE)))
        for kind in dict.fromkeys(kinds):
            columns = [column for column, other in enumerate(kinds) if other == kind]
            whole[columns] = fitted_scale(
                off[:, columns].reshape(-1, 1), evidence[:, columns].reshape(-1, 1, len(EVIDENCE))
            )
        scales[name] = whole
    return replace(errors, scales={**errors.scales, **scales})


def _errors_when_fitted(scene: _Scene, lookup: PoseLookup, errors: LearnedErrors, clip: int) -> _Errors:
    """Of both ways of ``ik`` and ``dense``; nothing where the shape is refused."""
    stages = ("ik", "dense")
    seen = _clip(scene, 2000 + clip, *_SHAPE_PICTURES, motion=700)
    nothing = np.empty((0, DEGREES_OF_FREEDOM)), np.empty((0, DEGREES_OF_FREEDOM, len(EVIDENCE)))
    try:
        fitted = fitted_hand_shape(HandTracker(scene.hand, lookup, seen.cameras, errors), seen.pictures)
    except BadInput:
        return {scale_name(stage, followed): nothing for stage in stages for followed in (False, True)}
    own = PrintedHand(fitted.shape.skin(), scene.hand.pattern)
    found = {}
    for follows in (False, True):
        of_stages = _errors(scene, lookup, errors, stages, follows, clip, own)
        found |= {scale_name(stage, follows): those for stage, those in of_stages.items()}
    return found


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
    cameras: tuple[Camera, ...]


@dataclass(frozen=True, eq=False)
class _Scene:
    """What is photographed: a hand of its own in every clip."""

    hand: PrintedHand
    count: int
    """Of cameras."""
    colours: ColourTable

    def cameras(self, seed: int) -> tuple[Camera, ...]:
        """Lenses of their own; the second looks at the same place from 35 to 90 degrees aside."""
        rng, found = np.random.default_rng([seed, 15]), []
        for number in range(self.count):
            focal, k1 = rng.uniform(*_FOCAL_PX), rng.uniform(-0.15, 0.05)
            angle = np.radians(rng.choice((-1.0, 1.0)) * rng.uniform(*_ASIDE_DEG)) * number
            sine, cosine = float(np.sin(angle)), float(np.cos(angle))
            turn = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
            shift = (np.eye(3) - turn) @ (0.0, 0.0, _MEETING_MM)
            rows = tuple(tuple(map(float, row)) for row in turn)
            found.append(
                Camera(focal_px=(focal, focal), distortion=(k1, 0.0, 0.0, 0.0, 0.0), rotation=rows,
                       translation_mm=(float(shift[0]), float(shift[1]), float(shift[2])))
            )  # fmt: skip
        return tuple(found)


def _clip(
    scene: _Scene, seed: int, frames: int, rate_hz: float, cone_deg: float = CONE_DEG, motion: int = 0
) -> _Clip:
    """Photographs, their colours classified; of another ``motion`` with the same hand, glove and room."""
    hand, cameras = scene.hand, scene.cameras(seed)
    other, rng = other_hand(hand.skin, seed), np.random.default_rng([seed, 4])
    seconds = np.arange(frames) / rate_hz
    states = hand_motion(other, frames / rate_hz, rate_hz, seed=seed + motion, cone_deg=cone_deg)[:frames]
    glove, look = displaced(other, hand.pattern, seed), some_light(rng, ("skin", "sleeve")[seed % 2])
    rooms = [
        Photographer(other, glove, camera, look, seed + number * 1_000_000)
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
    return _Clip([states[i] for i in kept], [pictures[i] for i in kept], seconds[kept], cameras)


def _at_the_end_of_exposure(states: Sequence[HandState], index: int, rate_hz: float) -> HandState | None:
    """None in clips of few pictures a second: between two of them nobody knows the way."""
    if rate_hz < _CLOSE[1] or index + 1 == len(states):
        return None
    return states[index].moved(_EXPOSURE_S * rate_hz * states[index + 1].step_from(states[index]))


def _blend_errors(scene: _Scene, lookup: PoseLookup, clip: int) -> np.ndarray:
    """(N, 26), of hands turned as far as the database's are."""
    plain = LearnedErrors.as_posterior(np.eye(DEGREES_OF_FREEDOM), np.ones(DEGREES_OF_FREEDOM))
    frames, cone_deg = (2 * _APART[0], _APART[1]), DatabaseSettings().cone_deg
    made = _clip(replace(scene, count=1), 1000 + clip, *frames, cone_deg)
    tracker = HandTracker(scene.hand, lookup, made.cameras, plain, stage="blend")
    steps = []
    for state, views in zip(made.states, made.pictures, strict=True):
        glimpse = tracker.glimpse(views[0], made.cameras[0])
        if glimpse is not None:
            steps.append(state.step_from(glimpse.blend.state))
    return np.array(steps).reshape(-1, DEGREES_OF_FREEDOM)


_Errors = dict[str, tuple[np.ndarray, np.ndarray]]


def _errors(
    scene: _Scene, lookup: PoseLookup, errors: LearnedErrors, stages: Sequence[str], follows: bool, clip: int,
    own: PrintedHand | None = None,
) -> _Errors:  # fmt: skip
    """Per stage: errors (N, 26), evidence (N, 26, 6). ``own``: the hand as it was fitted."""
    made, found = _clip(scene, 2000 + clip, *(_CLOSE if follows else _APART)), {}
    for stage in stages:
        tracker = HandTracker(own or scene.hand, lookup, made.cameras, errors, stage=stage, follows=follows)
        errors_of, evidence_of = [], []
        for state, views, seconds in zip(made.states, made.pictures, made.seconds, strict=True):
            answer = tracker.answered(views, float(seconds))
            if answer is None or answer.followed != follows:
                continue
            errors_of.append(state.step_from(answer.state))
            evidence_of.append(answer.evidence)
        found[stage] = (
            np.array(errors_of).reshape(-1, DEGREES_OF_FREEDOM),
            np.array(evidence_of).reshape(-1, DEGREES_OF_FREEDOM, len(EVIDENCE)),
        )
    return found


def _joined(found: Sequence[_Errors], stage: str) -> tuple[np.ndarray, np.ndarray]:
    return (
        np.concatenate([clip[stage][0] for clip in found]),
        np.concatenate([clip[stage][1] for clip in found]),
    )


def _speed(skin: HandSkin, clips: int) -> np.ndarray:
    steps = []
    for clip in range(clips):
        states = hand_motion(skin, _CLOSE[0] / _CLOSE[1], _CLOSE[1], seed=3000 + clip)
        steps += [later.step_from(before) for before, later in pairwise(states)]
    return np.sqrt(np.square(steps).mean(axis=0)) * _CLOSE[1]
