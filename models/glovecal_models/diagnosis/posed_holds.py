"""Stretches in which a pose is held still, found in readings alone: by its name, else by its readings."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.diagnosis.signatures import LABELS, are_pose_labels, own_sensors
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

OUTERMOST_PCT = (2, 98)
BIN_S = 0.25
LONGEST_GAP_S = 1.0
"""Between frames of one hold; a longer gap ends it."""


@dataclass(frozen=True)
class PosedHold:
    """One pose, held still once."""

    take: str
    wearing: str
    pose: str
    start_s: float
    """On the frames' clock."""
    time_s: np.ndarray
    """(N,) seconds since the hold began, one value for each quarter of a second."""
    readings: np.ndarray
    """(N, S), means over the quarter seconds, in the sensors' spans."""

    @property
    def duration_s(self) -> float:
        return float(self.time_s[-1])


def sensor_spans(takes: Sequence[Take], sensors: Sequence[str]) -> np.ndarray:
    """(S,) what each sensor covers in these takes, raw, but for the outermost 2 %; 1 if it covers nothing."""
    every = np.concatenate([_readings(take, sensors) for take in takes])
    low, high = np.percentile(every, OUTERMOST_PCT, axis=0)
    return np.where(high > low, high - low, 1.0)


def degrees_of_spans(takes: Sequence[Take], layout: Layout) -> dict[str, float]:
    """For sensors whose own rotation was measured what their span stands for, degrees."""
    found = {}
    for rotation, sensor in own_sensors(layout, layout.rotations).items():
        angles = np.concatenate([take.reference_at_frames([rotation])[:, 0] for take in takes])
        angles = angles[np.isfinite(angles)]
        if len(angles) and not are_pose_labels(takes):
            low, high = np.percentile(angles, OUTERMOST_PCT)
            found[sensor] = float(high - low)
    return found


def posed_holds(
    takes: Sequence[Take], sensors: Sequence[str], limits: DiagnosisLimits = DIAGNOSIS_LIMITS
) -> list[PosedHold]:
    """The first still stretch of each stay in a pose, in the order of the takes.

    Takes without pose names are searched for still stretches; those with like readings share a name.
    """
    spans = sensor_spans(takes, sensors)
    found: list[PosedHold] = []
    for take in takes:
        labels = labels_at_frames(take)
        scaled = _readings(take, sensors) / spans
        stays = [(np.arange(len(take.time_s)), "")] if labels is None else _stays(labels)
        for rows, label in stays:
            if label:
                parts = list(_still_parts(take, scaled, rows, limits))[:1]
            elif labels is None:
                still = list(_still_parts(take, scaled, rows, limits))
                parts = _begun_anew(scaled, still, limits.hold_same_pose_share)
            else:
                parts = []
            found.extend(_held(take, label, scaled, part) for part in parts)
    return _named(found, limits.hold_same_pose_share)


def _begun_anew(scaled: np.ndarray, parts: Sequence[np.ndarray], same_pose: float) -> list[np.ndarray]:
    """Without those that go on after a small move: before a hold the hand comes from elsewhere."""
    kept = list(parts[:1])
    for before, part in itertools.pairwise(parts):
        away = np.abs(scaled[before[-1] : part[0] + 1] - scaled[part].mean(axis=0)).max(initial=0.0)
        if away > same_pose:
            kept.append(part)
    return kept


def _readings(take: Take, sensors: Sequence[str]) -> np.ndarray:
    return take.readings[:, [take.sensors.index(name) for name in sensors]]


def _stays(labels: Sequence[str]) -> Iterator[tuple[np.ndarray, str]]:
    values = np.array(labels, dtype=object)
    changes = np.flatnonzero(values[1:] != values[:-1]) + 1
    for rows in np.split(np.arange(len(values)), changes):
        yield rows, str(values[rows[0]])


def _still_parts(
    take: Take, scaled: np.ndarray, rows: np.ndarray, limits: DiagnosisLimits
) -> Iterator[np.ndarray]:
    """The pieces of ``rows`` without a gap in which no sensor moves, long enough to be judged."""
    time = take.time_s[rows]
    for piece in np.split(np.arange(len(rows)), np.flatnonzero(np.diff(time) > LONGEST_GAP_S) + 1):
        second = np.floor(time[piece] - time[piece[0]]).astype(int)
        means = _binned(scaled[rows[piece]], second)
        numbers = np.unique(second)
        moves = (np.abs(np.diff(means, axis=0)) > limits.hold_moved_share).any(axis=1)
        for part in np.split(np.arange(len(numbers)), np.flatnonzero(moves) + 1):
            inside = piece[np.isin(second, numbers[part])]
            if time[inside[-1]] - time[inside[0]] >= limits.hold_shortest_s:
                yield rows[inside]


def _held(take: Take, pose: str, scaled: np.ndarray, rows: np.ndarray) -> PosedHold:
    start = float(take.time_s[rows[0]])
    number = ((take.time_s[rows] - start) / BIN_S).astype(int)
    time = _binned(take.time_s[rows, None] - start, number)[:, 0]
    return PosedHold(take.name, take.wearing, pose, start, time, _binned(scaled[rows], number))


def _binned(values: np.ndarray, number: np.ndarray) -> np.ndarray:
    """Means of the rows (N, S) that share a number; the numbers (N,) do not fall."""
    starts = np.flatnonzero(np.concatenate([[True], np.diff(number) > 0]))
    counts = np.diff(np.append(starts, len(number)))
    return np.add.reduceat(values, starts, axis=0) / counts[:, None]


def _named(found: Sequence[PosedHold], same_pose: float) -> list[PosedHold]:
    """Holds without a name get that of the first with like readings."""
    levels: list[np.ndarray] = []
    result = []
    for hold in found:
        if not hold.pose:
            level = np.median(hold.readings, axis=0)
            near = [i for i, other in enumerate(levels) if np.abs(other - level).max() <= same_pose]
            if not near:
                levels.append(level)
            hold = replace(hold, pose=f"pose {near[0] + 1 if near else len(levels)}")
        result.append(hold)
    return result


def labels_at_frames(take: Take) -> tuple[str, ...] | None:
    """A pose name for each frame: the take's own, else its reference where that only names poses."""
    if take.poses is not None:
        return take.poses
    if not take.rotations:
        return None
    measured = take.reference[np.isfinite(take.reference)]
    if not len(measured) or not np.isin(measured, LABELS).all():
        return None
    levels = take.reference_at_frames(take.rotations)
    return tuple(_label(take.rotations, row) for row in levels)


def _label(rotations: Sequence[str], values: np.ndarray) -> str:
    if not np.isfinite(values).all():
        return ""
    if len(values) > 1 and len(set(values.tolist())) == 1:
        return f"reference {values[0]:g}"
    return ", ".join(f"{name} {value:g}" for name, value in zip(rotations, values, strict=True))
