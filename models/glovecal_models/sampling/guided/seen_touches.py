"""Which touches of a sampling can be believed, and in which frames; others are refused with the reason."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import HAND_ROTATIONS
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.inverse_kinematics.contact import Rod, Touch
from glovecal_models.inverse_kinematics.follow import follow
from glovecal_models.inverse_kinematics.predicted_hand import PredictedHand
from glovecal_models.inverse_kinematics.steadied import steadied
from glovecal_models.inverse_kinematics.tip_chains import TipChains
from glovecal_models.inverse_kinematics.touch_check import (
    TouchNotSeen,
    judged,
    require_happened,
    require_possible,
)
from glovecal_models.sampling.guided.taught_take import TaughtTake
from glovecal_models.sampling.guided.touch_posterior import TouchFrames, TouchPosterior
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
    takes: Iterable[TaughtTake], first: TouchPosterior, skeleton: Skeleton
) -> tuple[list[SeenTouch], list[RefusedTouch]]:
    """Every contact of ``takes`` looked at through ``first``, the calibration without any touch."""
    seen: list[SeenTouch] = []
    refused: list[RefusedTouch] = []
    for taught in takes:
        for pose, contact in taught.contacts.items():
            try:
                seen.append(_seen(taught, pose, contact, first, skeleton))
            except BadInput as error:
                brief = error.brief if isinstance(error, TouchNotSeen) else f"{error}."
                refused.append(RefusedTouch(taught.take.name, pose, str(error), brief))
    return seen, refused


def _seen(
    taught: TaughtTake, pose: str, contact: Touch | Rod, first: TouchPosterior, skeleton: Skeleton
) -> SeenTouch:
    chains = TipChains(skeleton, contact.fingers)
    require_possible(chains, contact, skeleton)
    take, rows = taught.take, taught.frames(pose)
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
    """As the beliefs see it in ``readings`` (N, S)."""
    mean = np.column_stack([first.angles(name, readings) for name in HAND_ROTATIONS])
    variance = np.column_stack([first.variance(name, readings) for name in HAND_ROTATIONS])
    new = np.array([first.beliefs[name].prior.frame_sd_deg for name in HAND_ROTATIONS])
    return PredictedHand(mean, np.sqrt(variance + new**2), np.zeros(mean.shape, dtype=bool))
