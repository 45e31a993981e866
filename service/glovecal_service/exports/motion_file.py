"""One hand's take, or both hands', as a motion file: raw, or predicted by a model.

All that is needed is plain data, so that a process of its own can write it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from glovecal_models.calibration.artifact import load
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.offline import OfflinePredictor
from glovecal_models.calibration.predictor import FAULTY_SENSOR, TOO_UNCERTAIN, GlovePredictor
from glovecal_models.calibration.samples import require_layout
from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import PALM, Handedness
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.takes.hand_clocks import TakeClock, align, common_events
from glovecal_models.takes.take import Take
from glovecal_models.takes.time_code import TimeCode
from glovecal_service.exports.body_markers import Wrist, hand_frame, read_trc
from glovecal_service.exports.character_fit import CharacterFit
from glovecal_service.exports.formats import format_of, require_possible
from glovecal_service.exports.hand_motion import Content, HandMotion, on_one_time
from glovecal_service.exports.onto import read_onto
from glovecal_service.exports.resampling import Resampling
from glovecal_service.store.records import SubjectRecord


def motion_of(
    take: Take, model: CalibrationModel | None, skeleton: Skeleton, label: str, *, offline: bool = False
) -> HandMotion:
    """From where the take was asked for; its pre-roll only tells effects with a memory where they stand.

    ``offline``: estimated with both directions of time. Angles that are too uncertain, or read from a sensor
    that fails, are NaN. Raises LayoutMismatch.
    """
    asked = np.ones(len(take.time_s), bool) if take.begins_s is None else take.time_s >= take.begins_s
    count = int(asked.sum())
    rotations: tuple[str, ...] = ()
    degrees = sd_deg = np.empty((count, 0))
    flags = np.empty((count, 0), np.uint8)
    if model is not None:
        require_layout(take, model.layout)
        predictor = OfflinePredictor(model) if offline else GlovePredictor(model)
        columns = [take.sensors.index(name) for name in model.layout.sensors]
        found = predictor.predict_take(take.time_s, take.readings[:, columns], take.context, take.wearing)
        unusable = (found.flags & (TOO_UNCERTAIN | FAULTY_SENSOR)) > 0
        rotations = predictor.rotations
        degrees = np.where(unusable, np.nan, found.mean)[asked]
        sd_deg = np.where(unusable, np.nan, found.sd)[asked]
        flags = found.flags[asked]
    return HandMotion(
        label, take.time_s[asked], take.sensors, take.readings[asked], rotations, degrees, sd_deg, skeleton,
        take.simulated, flags,
    )  # fmt: skip


def measured_motion(take: Take, skeleton: Skeleton, label: str) -> HandMotion:
    """The angles that were measured, at their own times; readings are those of the nearest frame. Raises
    BadInput where none were."""
    rows = np.isfinite(take.reference).any(axis=1) & (take.reference_time_s >= take.start_s)
    if not rows.any():
        raise BadInput(f"take {take.name} has no measured angles to export; name a model")
    time_s = take.reference_time_s[rows]
    after = np.clip(np.searchsorted(take.time_s, time_s), 1, max(len(take.time_s) - 1, 1))
    nearest = np.where(time_s - take.time_s[after - 1] < take.time_s[after] - time_s, after - 1, after)
    degrees = take.reference[rows]
    sd_deg = np.full_like(degrees, np.nan) if take.reference_sd is None else take.reference_sd[rows]
    return HandMotion(
        label, time_s, take.sensors, take.readings[nearest], take.rotations, degrees, sd_deg, skeleton,
        take.simulated, measured=True,
    )  # fmt: skip


CLAPS_WITHIN_S = 5.0
MOST_FRAMES = 2_000_000
"""Of all hands together: four hours and a half at 120 Hz."""
SHORT = 10_000
"""Frames that are written before a process of its own would have started."""


@dataclass(frozen=True)
class HandTake:
    """A take and what makes it a hand's motion."""

    take: Take
    subject: SubjectRecord
    hand: Handedness
    artifact: bytes | None
    """The model's; None for raw readings, and for measured angles."""
    model: str | None
    """Its id."""
    measured: bool
    """The take's own reference angles are wanted."""
    accounting: Mapping[str, Any] | None
    time_code: TimeCode | None = None
    offline: bool = False
    """The model's angles are estimated with both directions of time."""

    @property
    def label(self) -> str:
        return "L" if self.hand == "left" else "R"

    def motion(self) -> HandMotion:
        model = None if self.artifact is None else load(self.artifact)
        notes = {"take": self.take.name, "hand": self.hand, "model": self.model, "measured": self.measured}
        if self.measured:
            palm = "arching" if PALM in self.take.rotations else "rigid"
            found = measured_motion(self.take, self.subject.skeleton(self.hand, palm), self.label)
            return replace(found, notes=notes | self._labelled(found))
        skeleton = self.subject.skeleton(self.hand, "rigid" if model is None else model.palm)
        found = motion_of(self.take, model, skeleton, self.label, offline=self.offline)
        return replace(found, notes=notes | {"offline": self.offline} | self._labelled(found))

    def _labelled(self, motion: HandMotion) -> dict[str, str]:
        """The time code of the first frame."""
        if self.time_code is None or not len(motion.time_s):
            return {}
        label = self.time_code.at(float(motion.time_s[0]))
        return {"time_code": label, "time_code_rate": self.time_code.counting.named}


@dataclass(frozen=True)
class Body:
    """Markers of an optical system, in a TRC file."""

    file: Path
    shift_s: float | None
    right: tuple[str, ...]
    left: tuple[str, ...]


@dataclass(frozen=True)
class MotionFile:
    hands: tuple[HandTake, ...]
    content: Content
    path: Path
    """Its ending is the format."""
    shifts_s: tuple[float, ...]
    claps: bool
    wrist: Wrist
    body: Body | None
    resampling: Resampling
    onto: Path | str | None = None
    """A file of a character or a robot, or a robot's name: what is to move instead of a body at rest."""
    bones: Mapping[str, str] = field(default_factory=dict)
    """Of it, by the hand's, where others are meant than those that are found; see ``bones_of``."""

    def __post_init__(self) -> None:
        labels = [hand.label for hand in self.hands]
        if len(set(labels)) < len(labels):
            raise BadInput(
                "both takes are of the same hand; if one is not, say so, in the order of the takes: "
                "--hand right --hand left"
            )
        require_possible(format_of(self.path.name), self.content)
        if self.body is not None and (self.content, self.path.suffix) != ("joints", ".trc"):
            raise BadInput("markers of a body are joined to joints in a TRC file: content joints, format trc")
        if self.bones and self.onto is None:
            raise BadInput("bones are named, but nothing onto which the motion goes; name it, too")
        if self.frames > MOST_FRAMES:
            raise BadInput(f"{self.frames} frames are too many for one file; export at most {MOST_FRAMES}")

    @property
    def frames(self) -> int:
        return sum(len(hand.take.time_s) for hand in self.hands)

    @property
    def is_short(self) -> bool:
        return self.frames <= SHORT and self.body is None


def write_motion(asked: MotionFile) -> None:
    """Raises BadInput, LayoutMismatch, DamagedArtifact."""
    hands = hands_in_motion(asked)
    if asked.onto is not None:
        read_onto(asked.onto).write(hands, asked.content, asked.path, asked.bones)
    else:
        format_of(asked.path.name).write(hands, asked.content, asked.path)


def fits(asked: MotionFile) -> list[CharacterFit]:
    """How well the character or robot shows each hand. Raises as ``write_motion``."""
    assert asked.onto is not None
    onto = read_onto(asked.onto)
    return [
        CharacterFit.of(motion, onto.shown(motion.skeleton, asked.bones)) for motion in hands_in_motion(asked)
    ]


def hands_in_motion(asked: MotionFile) -> list[HandMotion]:
    """On one time, resampled as asked."""
    motions = [hand.motion() for hand in asked.hands]
    if len(motions) > 1 and not asked.shifts_s:
        clocks = [TakeClock.of_accounting(hand.accounting) for hand in asked.hands]
        first, second = (hand.take for hand in asked.hands)
        found = align(first, second, (clocks[0], clocks[1]), claps=asked.claps)
        motions[1] = replace(motions[1], time_s=found.onto_first(motions[1].time_s))
    hands = list(on_one_time(motions, asked.shifts_s))
    if asked.wrist == "optical":
        hands = [replace(one, wrist="optical") for one in hands]
    if asked.body is not None:
        hands = _with_body(asked, asked.body, hands)
    return asked.resampling.of(hands)


def _with_body(asked: MotionFile, body: Body, hands: Sequence[HandMotion]) -> list[HandMotion]:
    """Hands placed by the body's markers where those are named, and the markers beside the first."""
    found = read_trc(body.file, "the body's file")
    shift_s = float(hands[0].time_s[0] - found.time_s[0]) if body.shift_s is None else body.shift_s
    if asked.claps:
        moved = replace(found, time_s=found.time_s + shift_s).as_take()
        shift_s += common_events(asked.hands[0].take, moved, CLAPS_WITHIN_S).shift_s
    at = replace(found, time_s=found.time_s + shift_s).at(hands[0].time_s)
    placed = []
    for hand in hands:
        is_left = hand.label == "L"
        names = body.left if is_left else body.right
        frame = hand_frame(at, names, asked.wrist, is_left=is_left) if names else None
        placed.append(replace(hand, frame=frame))
    return [replace(placed[0], beside=at), *placed[1:]]
