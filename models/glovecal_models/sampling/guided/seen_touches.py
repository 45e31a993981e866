"""Which touches of a sampling can be believed, and in which frames; others are refused with the reason.

A touch is first looked at by itself, then beside the others: one that the likeliest calibration of the whole
session leaves open cannot be true.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import FINGERS, HAND_ROTATIONS
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.inverse_kinematics.contact import Rod, Touch
from glovecal_models.inverse_kinematics.follow import follow
from glovecal_models.inverse_kinematics.hand_shape import PredictedHand
from glovecal_models.inverse_kinematics.steadied import steadied
from glovecal_models.inverse_kinematics.tip_chains import TipChains
from glovecal_models.inverse_kinematics.touch_check import (
    TouchNotSeen,
    judged,
    require_happened,
    require_possible,
)
from glovecal_models.progress import Cancel
from glovecal_models.sampling.guided.labelled_takes import LabelledTake
from glovecal_models.sampling.guided.rotation_posterior import RotationPosterior
from glovecal_models.sampling.guided.touch_posterior import TouchFrames, TouchPosterior
from glovecal_models.sampling.limits import SAMPLING_LIMITS, SamplingLimits
from glovecal_models.takes.take import Take

LOOKED_AT = 60
"""Frames of each touch that are worked out one by one; their neighbours are alike."""


@dataclass(frozen=True)
class SeenTouch:
    """A contact that happened."""

    take: Take
    pose: str
    contact: Touch | Rod
    rotations: tuple[str, ...]
    """That move its tips."""
    rows: np.ndarray
    """Of the take: all frames in which it is believed."""
    readings: np.ndarray
    """(len(rows), S), without the sensors' noise."""
    apart_mm: float
    """How far the first calibration read the tips from where they were (median)."""

    def some(self, most: int) -> TouchFrames:
        """At most about ``most`` frames, evenly in time."""
        return TouchFrames(self.contact, self.readings[:: max(1, -(-len(self.rows) // most))])


@dataclass(frozen=True)
class RefusedTouch:
    take: str
    pose: str
    reason: str
    brief: str
    """The same in few words."""


def seen_touches(
    takes: Iterable[LabelledTake], first: TouchPosterior, skeleton: Skeleton
) -> tuple[list[SeenTouch], list[RefusedTouch]]:
    """Every contact of ``takes`` looked at through ``first``, the calibration without any touch."""
    seen: list[SeenTouch] = []
    refused: list[RefusedTouch] = []
    for labelled in takes:
        for pose, contact in labelled.contacts.items():
            try:
                seen.append(_seen(labelled, pose, contact, first, skeleton))
            except BadInput as error:
                brief = error.brief if isinstance(error, TouchNotSeen) else f"{error}."
                refused.append(RefusedTouch(labelled.take.name, pose, str(error), brief))
    return seen, refused


def _seen(
    labelled: LabelledTake, pose: str, contact: Touch | Rod, first: TouchPosterior, skeleton: Skeleton
) -> SeenTouch:
    chains = TipChains(skeleton, contact.fingers)
    require_possible(chains, contact, skeleton)
    take, rows = labelled.take, labelled.frames(pose)
    if not len(rows):
        raise BadInput(f"no frame of take {take.name!r} is named {pose!r}")
    smooth = steadied(take.time_s[rows], take.readings[rows].astype(float))
    some = np.arange(0, len(rows), max(1, len(rows) // LOOKED_AT))
    hand = _hand(first, smooth[some])
    shape = hand.shape(chains)
    verdict = judged(chains, contact, shape, follow(chains, contact, shape))
    require_happened(verdict, contact, hand, skeleton)
    nearest = np.abs(np.arange(len(rows))[:, None] - some).argmin(axis=1)
    kept = verdict.believable[nearest]
    apart = float(np.median(verdict.apart_mm))
    return SeenTouch(take, pose, contact, chains.rotations, rows[kept], smooth[kept], apart)


def _hand(first: TouchPosterior, readings: np.ndarray) -> PredictedHand:
    """As the priors see it in ``readings`` (N, S)."""
    mean = np.column_stack([first.angles(name, readings) for name in HAND_ROTATIONS])
    variance = np.column_stack([first.variance(name, readings) for name in HAND_ROTATIONS])
    new = np.array([first.priors[name].prior.frame_sd_deg for name in HAND_ROTATIONS])
    return PredictedHand(mean, np.sqrt(variance + new**2), np.zeros(mean.shape, dtype=bool))


FRAMES_A_TOUCH = 100
"""Of each touch that the search for the likeliest calibration looks at."""


def closing_touches(
    priors: Mapping[str, RotationPosterior],
    sensors: Sequence[str],
    skeleton: Skeleton,
    seen: Sequence[SeenTouch],
    cancelled: Cancel | None = None,
    limits: SamplingLimits = SAMPLING_LIMITS,
) -> tuple[TouchPosterior, list[SeenTouch], list[RefusedTouch]]:
    """The likeliest calibration, the touches it rests on, and those that contradict. Raises Cancelled."""
    kept, refused = list(seen), []
    most = limits.touch_most_left_mm
    while True:
        touches = [touch.some(FRAMES_A_TOUCH) for touch in kept]
        posterior = TouchPosterior(priors, sensors, skeleton, touches, cancelled)
        left = [float(np.median(posterior.apart_mm(touch, skeleton))) for touch in touches]
        if not left or max(left) <= most:
            return posterior, kept, refused
        strange = kept.pop(int(np.argmax(left)))
        reason = (
            f"with the other touches and poses {max(left):.0f} mm are left between the tips, at most "
            f"{most:g} are believed. Repeat the motion with the tips together, or check the hand's "
            "dimensions"
        )
        brief = f"{max(left):.0f} mm are left between the tips with the other touches."
        refused.append(RefusedTouch(strange.take.name, strange.pose, reason, brief))


SHOWN = 4


def guided_sentences(
    seen: Sequence[SeenTouch],
    refused: Sequence[RefusedTouch],
    told: Mapping[str, float],
    posterior: TouchPosterior,
    skeleton: Skeleton | None,
) -> list[str]:
    """Of touches: what each closed, what they told most of, and which were refused."""
    said = [_closed(touch, posterior, skeleton) for touch in seen if skeleton is not None]
    if told:
        most = sorted(told, key=lambda name: -told[name])[:SHOWN]
        shares = ", ".join(f"{name} {100 * told[name]:.0f} %" for name in most)
        said.append(f"Of what poses and widgets left open of a joint the touches told most of {shares}.")
    said += [f"Left out: {each.pose} of take {each.take}: {each.reason}." for each in refused]
    return said


def hold_sentence(holds: int, sd_deg: float) -> str:
    return (
        f"{holds} poses were held, {sd_deg:.1f} degrees (standard deviation) from the angles they are said "
        "to have: each counts as one sample of that accuracy, however many frames it has."
    )


def nothing_left(has_skeleton: bool, touches: int, refused: Sequence[RefusedTouch]) -> str:
    """Why there is nothing to train on."""
    if refused:
        reasons = "; ".join(f"{each.pose}: {each.reason}" for each in refused)
        return f"no take has known angles, and every touch was refused ({reasons})"
    if touches and not has_skeleton:
        return "touches need the subject's hand dimensions, and no other take has known angles"
    return "no pose, no widget and no touch among these takes"


def _closed(touch: SeenTouch, posterior: TouchPosterior, skeleton: Skeleton) -> str:
    left = float(np.median(posterior.apart_mm(touch.some(60), skeleton)))
    first, second = (FINGERS[finger] for finger in touch.contact.fingers)
    what = f"{first} and {second} at the rod" if isinstance(touch.contact, Rod) else f"{first} and {second}"
    return (
        f"Tips of {what}: read {touch.apart_mm:.1f} mm off before, {left:.1f} mm with what all touches tell "
        f"(median of {len(touch.rows)} frames)."
    )
