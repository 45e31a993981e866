"""The frames of a take in which a rotation was kept still, as the examination needs them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass

import numpy as np

from glovecal_models.independence.active_range import ActiveRange
from glovecal_models.independence.coupling import Coupling
from glovecal_models.independence.coupling_columns import BLOCK_S
from glovecal_models.independence.smooth_readings import SmoothTake, span
from glovecal_models.independence.still_rotation import moved_in_name

START_S = 0.4
"""Crosstalk is counted from where the joints were in the take's first moments."""
LEAST_MOVED = 0.1
"""Of its own range; a joint that moved less can tell nothing."""


@dataclass(frozen=True)
class KnownCrosstalk:
    """Results of the examinations before."""

    coupled: Set[str]
    """Sensors that are cross-coupled."""
    crosstalk: Mapping[str, Coupling]
    """Those of them that only uncoupled sensors affect: these can be relied on."""


NO_CROSSTALK = KnownCrosstalk(frozenset(), {})


@dataclass(frozen=True)
class StillFrames:
    """One take: N frames."""

    target: np.ndarray
    """Shape (N,), readings of the still sensor."""
    moved: dict[str, np.ndarray]
    """The others, shape (N,), shares of their range from where the takes began."""
    block: np.ndarray
    """Shape (N,): numbers of pieces of time."""
    own_deg: np.ndarray | None
    """Shape (N,): the rotation's own angle about its mean, None where it was not measured."""
    moves_only: tuple[str, ...]
    """The sensors that the take's name says were moved; empty when it says nothing."""

    @property
    def moving(self) -> int:
        """How many joints moved at once."""
        return sum(bool(np.ptp(share) >= LEAST_MOVED) for share in self.moved.values())


def still_frames(
    takes: Sequence[SmoothTake],
    rotation: str,
    sensor: str,
    ranges: Mapping[str, ActiveRange],
    known: KnownCrosstalk,
) -> list[StillFrames]:
    """One of each take. Joints are counted from a beginning that all takes share.

    Where names of takes say which joints moved, others are no candidates in any of them.
    """
    said = [moved_in_name(item.take.name, tuple(ranges)) for item in takes]
    named = {name for names in said for name in names} or set(ranges)
    began = _beginnings(takes, ranges)
    return [
        _frames(item, rotation, sensor, ranges, set(names) or named, names, began, known)
        for item, names in zip(takes, said, strict=True)
    ]


def alone(frames: Sequence[StillFrames]) -> list[StillFrames]:
    """Takes in which a single joint moved, by their names, if there is one for each joint that any take
    names: then nothing has to be taken apart. Else none."""
    named = {name for item in frames for name in item.moves_only}
    single = [item for item in frames if len(item.moves_only) == 1]
    return single if {item.moves_only[0] for item in single} == named else []


def constants(frames: Sequence[StillFrames]) -> np.ndarray:
    """One constant for each take, and the rotation's own angle where every take has it, shape (N, C)."""
    lengths = [len(item.target) for item in frames]
    columns = [np.repeat(np.eye(len(frames))[:, number], lengths) for number in range(len(frames))]
    own = [item.own_deg for item in frames if item.own_deg is not None]
    if len(own) == len(frames):
        columns.append(np.concatenate(own))
    return np.column_stack(columns)


def deviations(frames: Sequence[StillFrames], scale: float, own_angle: np.ndarray) -> tuple[float, float]:
    """Standard and largest deviation from each take's mean, of takes in which most joints moved at once.

    ``own_angle`` (1,) is what a degree of the joint itself does, or (0,) where that is not known.
    """
    most = max(item.moving for item in frames)
    pieces = []
    for item in frames:
        if item.moving == most:
            piece = scale * item.target
            if len(own_angle) and item.own_deg is not None:
                piece = piece - own_angle[0] * item.own_deg
            pieces.append(piece - piece.mean())
    centred = np.concatenate(pieces)
    return float(centred.std()), float(np.abs(centred).max())


def _beginnings(takes: Sequence[SmoothTake], ranges: Mapping[str, ActiveRange]) -> dict[str, float]:
    """Where each joint is at the beginning: the median over takes."""
    began = {}
    for name in ranges:
        if all(name in item.take.sensors for item in takes):
            starts = [np.median(_place(item, name, ranges[name])[: _first(item)]) for item in takes]
            began[name] = float(np.median(starts))
    return began


def _first(item: SmoothTake) -> int:
    return max(int((item.time_s < item.time_s[0] + START_S).sum()), 1)


def _frames(
    item: SmoothTake,
    rotation: str,
    sensor: str,
    ranges: Mapping[str, ActiveRange],
    candidates: Set[str],
    moves_only: tuple[str, ...],
    began: Mapping[str, float],
    known: KnownCrosstalk,
) -> StillFrames:
    everything = {name: _place(item, name, ranges[name]) - began[name] for name in began}
    moved = {}
    for name in everything:
        has_moved = item.has_moved(name)
        own = _of_its_own(name, everything, item, known) if has_moved else everything[name]
        is_cause = has_moved and name in candidates
        moved[name] = own if is_cause else np.full(len(own), 0.0 if has_moved else np.median(own))
    moved.pop(sensor, None)
    angle = item.angle(rotation)
    if angle is not None:
        angle = np.where(np.isfinite(angle), angle, np.nanmean(angle)) - np.nanmean(angle)
    return StillFrames(item.reading(sensor), moved, np.floor(item.time_s / BLOCK_S), angle, moves_only)


def _place(item: SmoothTake, name: str, known: ActiveRange) -> np.ndarray:
    """Where a joint is, in shares of its range: by its angle where that was measured, since its sensor may be
    cross-coupled itself; else by its sensor."""
    angle = item.angle(name)
    if angle is not None and known.angle_deg:
        measured = np.isfinite(angle)
        return np.interp(item.time_s, item.time_s[measured], angle[measured]) / known.angle_deg
    reading = item.reading(name)
    return reading / (max(known.readings, span(reading)) or 1.0)


def _of_its_own(
    name: str, everything: dict[str, np.ndarray], item: SmoothTake, known: KnownCrosstalk
) -> np.ndarray:
    """A sensor's movement without its known crosstalk; a measured angle needs no such care."""
    if item.angle(name) is not None or name not in known.crosstalk:
        return everything[name]
    return everything[name] - known.crosstalk[name].crosstalk(everything) / 100
