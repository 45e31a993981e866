"""One rotation examined: what its sensor did while it was kept still and others moved.

The source is Wang & Neff 2013, section 3.1: standard and largest deviation in per cent of the active range.
What a joint did that moved all the same is taken out where its angle was measured. Where it was not, a joint
that moves along with a neighbour looks like that neighbour's pull.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass

import numpy as np

from glovecal_models.independence.active_range import ActiveRange
from glovecal_models.independence.affecting_shares import TakenApart, follows_the_rule, take_apart
from glovecal_models.independence.pull_columns import BLOCK_S
from glovecal_models.independence.smooth_readings import SmoothTake, span
from glovecal_models.independence.still_rotation import Stillness, stillness
from glovecal_models.independence.take_names import moved_in_name

START_S = 0.4
"""The neighbours' pulls are counted from where they were in the take's first moments."""
LEAST_MOVED = 0.1
"""Of its own range; a sensor that moved less can tell nothing."""
LEAST_BLOCKS = 10
UNEXPLAINED_PCT = 5.0
"""Of the range: so much that no other sensor explains is a joint that was not still."""


@dataclass(frozen=True)
class KnownPulls:
    """What other examinations have told."""

    pulled: Set[str]
    """Sensors that are cross-coupled."""
    pulls: Mapping[str, TakenApart]
    """Those of them that only sensors pull on which are not: these pulls can be relied on."""


NOTHING_KNOWN = KnownPulls(frozenset(), {})


@dataclass(frozen=True)
class RotationExamination:
    """Per cent of the own sensor's active range."""

    rotation: str
    sensor: str
    takes: tuple[str, ...]
    seconds: float
    std_pct: float
    max_pct: float
    is_coupled: bool
    """By the paper's rule, from 5 % standard or 12 % largest deviation on."""
    taken_apart: TakenApart
    stillness: Stillness | None
    """By measured angles; None where there are none."""
    active_range: ActiveRange
    not_moved: tuple[str, ...]
    """Sensors that moved too little to tell whether they affect this one."""
    is_dead: bool
    """The sensor does not move at all in any take."""
    doubts: tuple[str, ...]


def examine_rotation(
    rotation: str,
    sensor: str,
    takes: Sequence[SmoothTake],
    ranges: Mapping[str, ActiveRange],
    *,
    dead: bool = False,
    known: KnownPulls = NOTHING_KNOWN,
) -> RotationExamination | str:
    """From one or more takes in which ``rotation`` was kept still, at the same angle or at others.

    A sensor that is pulled itself can look like a cause, so ``known`` pulls are taken off. A sentence
    instead when nothing can be told in per cent, or the takes are too short.
    """
    scale = ranges[sensor].readings
    if not scale:
        return ranges[sensor].sentence or f"The range of {sensor} was not seen yet."
    named = {name for item in takes for name in moved_in_name(item.take.name, tuple(ranges))} or set(ranges)
    began = _beginnings(takes, ranges)
    parts = [_prepared(item, rotation, sensor, ranges, named, began, known) for item in takes]
    blocks = sum(len(np.unique(part.block)) for part in parts)
    if blocks < LEAST_BLOCKS:
        return (
            f"{rotation} was kept still for {blocks} s in all; move the others for {LEAST_BLOCKS} s or more."
        )
    causes = _alone(takes, parts, named, ranges) or parts
    names = [name for name in ranges if name != sensor and all(name in part.moved for part in causes)]
    moved = {name: np.concatenate([part.moved[name] for part in causes]) for name in names}
    moving = {name: share for name, share in moved.items() if np.ptp(share) >= LEAST_MOVED}
    apart = take_apart(
        _targets(causes) * 100 / scale, moving, _constants(causes), _blocks(causes), known.pulled
    )
    own_angle = apart.constants[len(causes) :]
    std, largest = _deviations(parts, 100 / scale, own_angle)
    still = _least_still(takes, rotation)
    return RotationExamination(
        rotation, sensor, tuple(item.take.name for item in takes),
        float(sum(item.time_s[-1] - item.time_s[0] for item in takes)),
        std, largest, follows_the_rule(std, largest), apart, still, ranges[sensor],
        tuple(name for name in names if name not in moving), dead,
        tuple([*_doubts(rotation, sensor, still, apart, ranges[sensor], dead), *_rough(takes, causes, parts, apart, sensor, known)]),
    )  # fmt: skip


@dataclass(frozen=True)
class _Prepared:
    """One take: N frames."""

    target: np.ndarray
    """Shape (N,), readings of the still sensor."""
    moved: dict[str, np.ndarray]
    """The others, shape (N,), shares of their range from where they began."""
    block: np.ndarray
    own_deg: np.ndarray | None
    """The rotation's own angle about its mean, where it was measured."""


def _beginnings(takes: Sequence[SmoothTake], ranges: Mapping[str, ActiveRange]) -> dict[str, float]:
    """Where each joint is at the beginning (median of the takes): the origin that all takes share."""
    began = {}
    for name in ranges:
        starts = []
        for item in takes:
            if name in item.take.sensors:
                first = max(int((item.time_s < item.time_s[0] + START_S).sum()), 1)
                starts.append(np.nanmedian(_place(item, name, ranges[name])[:first]))
        if starts:
            began[name] = float(np.median(starts))
    return began


def _prepared(
    item: SmoothTake,
    rotation: str,
    sensor: str,
    ranges: Mapping[str, ActiveRange],
    named: Set[str],
    began: Mapping[str, float],
    known: KnownPulls,
) -> _Prepared:
    candidates = set(moved_in_name(item.take.name, tuple(ranges))) or named
    everything = {name: _place(item, name, ranges[name]) - began[name] for name in began}
    moved = {}
    for name in everything:
        if name == sensor:
            continue
        has_moved = item.has_moved(name)
        own = _of_its_own(name, everything, item, known) if has_moved else everything[name]
        is_cause = has_moved and name in candidates
        moved[name] = own if is_cause else np.full(len(own), 0.0 if has_moved else np.median(own))
    angle = item.angle(rotation)
    if angle is not None:
        angle = np.where(np.isfinite(angle), angle, np.nanmean(angle)) - np.nanmean(angle)
    return _Prepared(item.reading(sensor), moved, np.floor(item.time_s / BLOCK_S), angle)


def _place(item: SmoothTake, name: str, known: ActiveRange) -> np.ndarray:
    """Where a joint is, in shares of its range: by its angle where that was measured, since its sensor may be
    pulled by others itself; else by its sensor."""
    angle = item.angle(name)
    if angle is not None and known.angle_deg:
        measured = np.isfinite(angle)
        return np.interp(item.time_s, item.time_s[measured], angle[measured]) / known.angle_deg
    reading = item.reading(name)
    return reading / (max(known.readings, span(reading)) or 1.0)


def _of_its_own(
    name: str, everything: dict[str, np.ndarray], item: SmoothTake, known: KnownPulls
) -> np.ndarray:
    """A sensor's movement without what is known to pull on it; a measured angle needs no such care."""
    if item.angle(name) is not None or name not in known.pulls:
        return everything[name]
    return everything[name] - known.pulls[name].pull(everything) / 100


def _alone(
    takes: Sequence[SmoothTake], parts: Sequence[_Prepared], named: Set[str], ranges: Mapping[str, ActiveRange]
) -> list[_Prepared]:
    """Takes in which, by their names, a single joint moved, if there is one for each that was named: then
    nothing has to be taken apart."""
    said = [moved_in_name(item.take.name, tuple(ranges)) for item in takes]
    if {names[0] for names in said if len(names) == 1} != named:
        return []
    return [part for part, names in zip(parts, said, strict=True) if len(names) == 1]


def _targets(parts: Sequence[_Prepared]) -> np.ndarray:
    return np.concatenate([part.target for part in parts])


def _blocks(parts: Sequence[_Prepared]) -> np.ndarray:
    return np.concatenate([part.block + 1e6 * number for number, part in enumerate(parts)])


def _constants(parts: Sequence[_Prepared]) -> np.ndarray:
    """One constant for each take, and the rotation's own angle where every take has it, shape (N, C)."""
    lengths = [len(part.target) for part in parts]
    columns = [np.repeat(np.eye(len(parts))[:, number], lengths) for number in range(len(parts))]
    own = [part.own_deg for part in parts if part.own_deg is not None]
    if len(own) == len(parts):
        columns.append(np.concatenate(own))
    return np.column_stack(columns)


def _deviations(parts: Sequence[_Prepared], scale: float, own_angle: np.ndarray) -> tuple[float, float]:
    """Standard and largest deviation from each take's mean, where most sensors moved at once.

    ``own_angle`` (1,) is what the joint's own degree does, or (0,) where that is not known."""
    moving = [sum(bool(np.ptp(share) >= LEAST_MOVED) for share in part.moved.values()) for part in parts]
    pieces = []
    for part, count in zip(parts, moving, strict=True):
        if count == max(moving):
            piece = scale * part.target
            if len(own_angle) and part.own_deg is not None:
                piece = piece - own_angle[0] * part.own_deg
            pieces.append(piece - piece.mean())
    centred = np.concatenate(pieces)
    return float(centred.std()), float(np.abs(centred).max())


def _rough(
    takes: Sequence[SmoothTake],
    causes: Sequence[_Prepared],
    parts: Sequence[_Prepared],
    apart: TakenApart,
    sensor: str,
    known: KnownPulls,
) -> list[str]:
    """Whether causes are told by sensors that others pull on: beside others their shares are rough."""
    if causes is not parts or len(apart.shares) < 2:
        return []
    rough = [
        share.sensor
        for share in apart.shares
        if share.sensor in known.pulled and any(item.angle(share.sensor) is None for item in takes)
    ]
    if not rough:
        return []
    return [
        f"Others pull on {' and '.join(rough)} too, so the shares in what {sensor} does are rough: measure the "
        f"angles, or move each joint alone, in takes called like still-{sensor}-move-{rough[0]}."
    ]


def _least_still(takes: Sequence[SmoothTake], rotation: str) -> Stillness | None:
    found = [how for item in takes if (how := stillness(item, rotation)) is not None]
    return max(found, key=lambda how: how.std_pct, default=None)


def _doubts(
    rotation: str,
    sensor: str,
    still: Stillness | None,
    apart: TakenApart,
    known: ActiveRange,
    dead: bool,
) -> list[str]:
    doubts = []
    if dead:
        doubts.append(f"Sensor {sensor} does not move in any take: is it broken, or its wire?")
    if still is not None and not still.is_still:
        doubts.append(
            f"{rotation} was not still: it moved by {still.std_pct:.0f} % of its range (standard deviation; "
            f"{still.span_pct:.0f} % from end to end). What its measured angle explains is taken out."
        )
    if still is None and apart.unexplained_pct >= UNEXPLAINED_PCT:
        doubts.append(
            f"{sensor} moved by {apart.unexplained_pct:.0f} % of its range in a way that goes with no other "
            f"sensor: was {rotation} really kept still? Nothing else here measures it."
        )
    for share in apart.shares:
        if share.rivals:
            doubts.append(
                f"{share.sensor} and {' and '.join(share.rivals)} always moved together, so which of them pulls "
                f"on {sensor} cannot be told: move each for some seconds by itself."
            )
    return [*doubts, *([known.sentence] if known.sentence else [])]
