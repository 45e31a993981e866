"""Readings and measured angles smoothed alike, so that a largest deviation is a movement and no noise.

Which rotations were kept still in a take, by its name or by measured angles, and whether they were.

``still-im_abd`` keeps IM_ABD still, ``still-IM_ABD-move-I_MCP`` moves only I_MCP, ``range IM_ABD`` takes
IM_ABD through its range.

How far each sensor reads while its own joint goes through its active range: the scale of every per cent.

Crosstalk of its neighbours lets a sensor read farther than its own joint alone. So the best source is a
take in which that joint moved alone; then the sensor's slope over measured angles, times the angles seen;
then all that was read in range takes, the neighbours' crosstalk included; at last what the hardware can send.

The frames of a take in which a rotation was kept still, as the examination needs them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG
from glovecal_models.independence.answer import ActiveRange, Stillness
from glovecal_models.independence.coupling import BLOCK_S, Coupling
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

WINDOW_S = 0.15
"""Shorter than any movement a hand makes, long enough to average several frames."""
KEPT_HZ = 25.0
"""Smoothed frames beyond this many a second tell nothing new."""
NOISE_SD = 6.0
"""A sensor moved when its smoothed readings span more than this many standard deviations of its noise."""
WANDER_PER_CENT = 1.0
"""Largest and smallest readings leave out this share at either end: single frames do not make a range."""


@dataclass(frozen=True)
class SmoothTake:
    """A take without its pre-roll, smoothed over ``WINDOW_S`` and thinned."""

    take: Take
    time_s: np.ndarray
    """Shape (N,), seconds."""
    readings: np.ndarray
    """Shape (N, S), readings, in the order of the take's sensors."""
    angles: np.ndarray
    """Shape (N, R), degrees, NaN where not measured, in the order of the take's rotations."""
    noise: np.ndarray
    """Shape (S,): standard deviation that noise has left in the smoothed readings."""

    def reading(self, sensor: str) -> np.ndarray:
        return self.readings[:, self.take.sensors.index(sensor)]

    def angle(self, rotation: str) -> np.ndarray | None:
        """Degrees, shape (N,); None when fewer than half of the frames have it."""
        if rotation not in self.take.rotations:
            return None
        found = self.angles[:, self.take.rotations.index(rotation)]
        return found if np.isfinite(found).mean() > 0.5 else None

    def has_moved(self, sensor: str) -> bool:
        column = self.take.sensors.index(sensor)
        return span(self.readings[:, column]) > NOISE_SD * self.noise[column]


def smooth_take(take: Take) -> SmoothTake:
    """Of a take with at least one frame."""
    first = min(take.pre_roll_frames, len(take.time_s) - 1)
    time, readings = take.time_s[first:], take.readings[first:]
    angles = take.reference_at_frames(take.rotations)[first:]
    interval = float(np.median(np.diff(time))) if len(time) > 1 else WINDOW_S
    window = int(min(max(round(WINDOW_S / interval), 1), max(len(time) // 4, 1)))
    step = max(round(1 / (KEPT_HZ * interval)), 1)
    steps = np.diff(readings, axis=0) if len(time) > 1 else np.zeros((1, readings.shape[1]))
    noise = np.median(np.abs(steps), axis=0) / (0.6745 * np.sqrt(2) * np.sqrt(window))
    return SmoothTake(
        take,
        _averaged(time[:, None], window)[::step, 0],
        _averaged(readings, window)[::step],
        _averaged(angles, window)[::step],
        noise,
    )


def span(values: np.ndarray) -> float:
    """Between the two ends, without the outermost ``WANDER_PER_CENT``; NaNs left out, 0 for nothing."""
    values = values[np.isfinite(values)]
    if not len(values):
        return 0.0
    low, high = np.percentile(values, [WANDER_PER_CENT, 100 - WANDER_PER_CENT])
    return float(high - low)


def _averaged(columns: np.ndarray, window: int) -> np.ndarray:
    """Means over ``window`` rows each; a window with NaN is NaN."""
    if window == 1 or columns.shape[1] == 0:
        return columns[: len(columns) - window + 1]
    return np.lib.stride_tricks.sliding_window_view(columns, window, axis=0).mean(axis=-1)


def rotation_in_name(name: str, rotations: Sequence[str]) -> str | None:
    """The longest of ``rotations`` that stands by itself in the name, before any "move"; or None."""
    found = _found(_words(name).partition("_move_")[0] + "_", rotations)
    return max(found, key=len, default=None)


def moved_in_name(name: str, rotations: Sequence[str]) -> tuple[str, ...]:
    """The rotations that stand after "move" in the name."""
    return tuple(_found("_" + _words(name).partition("_move_")[2], rotations))


def _words(name: str) -> str:
    return f"_{re.sub(r'[^0-9a-z]+', '_', name.lower())}_"


def _found(words: str, rotations: Sequence[str]) -> list[str]:
    """Longer names first, so that MCP is not found in I_MCP."""
    found = []
    for rotation in sorted(rotations, key=len, reverse=True):
        if f"_{rotation.lower()}_" in words:
            found.append(rotation)
            words = words.replace(f"_{rotation.lower()}_", "_/_")
    return found


USUAL_RANGE_DEG = 60.0
"""For a rotation that no hand is known to have (an ankle's)."""


def stillness(item: SmoothTake, rotation: str) -> Stillness | None:
    """None where the rotation was not measured."""
    angles = item.angle(rotation)
    if angles is None:
        return None
    low, high = ACTIVE_RANGE_DEG.get(rotation, (0.0, USUAL_RANGE_DEG))
    scale = 100 / (high - low)
    return Stillness(scale * float(np.nanstd(angles)), scale * span(angles))


def still_rotations(item: SmoothTake, layout: Layout, named: str | None = None) -> tuple[str, ...]:
    """The rotation that was named, that the take's name speaks of, or all that were measured as still.

    Raises BadInput when none of these tells, or the rotation has no sensor of its own.
    """
    said = named or rotation_in_name(item.take.name, layout.rotations)
    if said is not None:
        if layout.correspondence(said).measuring_sensor is None:
            raise BadInput(
                f"rotation {said} has no sensor of its own in layout {layout.name!r}: there is nothing to "
                "examine"
            )
        return (said,)
    having = [one.rotation for one in layout.correspondences if one.measuring_sensor is not None]
    found = tuple(name for name in having if (how := stillness(item, name)) is not None and how.is_still)
    if not found:
        if not having:
            raise BadInput(f"no rotation of layout {layout.name!r} has a sensor of its own to examine")
        raise BadInput(
            f"take {item.take.name!r} does not tell which rotation was kept still, and no measured rotation "
            f"was; call it like still-{having[0]}, or say which it was"
        )
    return found


def active_ranges(layout: Layout, takes: Sequence[SmoothTake]) -> dict[str, ActiveRange]:
    """One for each sensor of the layout, from takes in which joints went through their ranges."""
    return {sensor: _active_range(sensor, layout, takes) for sensor in layout.sensors}


def measured_slope(item: SmoothTake, sensor: str, layout: Layout) -> tuple[float, float] | None:
    """Readings per degree of the sensor's own rotation, and its standard error; None where the take cannot
    tell. Rotations of the sensors that the layout reads beside it are accounted for.

    Ordinary least squares; the error is doubled, as neighbouring frames err alike."""
    own = item.angle(sensor)
    if own is None or sensor not in layout.rotations:
        return None
    others = [item.angle(name) for name in layout.correspondence(sensor).sensors if name != sensor]
    columns = np.column_stack([own, *(one for one in others if one is not None and span(one) > 1.0)])
    known = np.isfinite(columns).all(axis=1)
    if known.sum() < 4 * columns.shape[1] or span(own[known]) < 1.0:
        return None
    centred = columns[known] - columns[known].mean(axis=0)
    reading = item.reading(sensor)[known]
    slopes, _, rank, _ = np.linalg.lstsq(centred, reading - reading.mean(), rcond=1e-6)
    if rank < columns.shape[1]:
        return None
    left = float((reading - reading.mean() - centred @ slopes).std())
    spread = np.linalg.inv(centred.T @ centred)[0, 0]
    return float(slopes[0]), float(np.sqrt(spread) * left * 2)


def _active_range(sensor: str, layout: Layout, takes: Sequence[SmoothTake]) -> ActiveRange:
    holding = [item for item in takes if sensor in item.take.sensors]
    own = [item for item in holding if rotation_in_name(item.take.name, layout.rotations) == sensor]
    angle = max((span(a) for item in holding if (a := item.angle(sensor)) is not None), default=None)
    readings, source = max((span(item.reading(sensor)) for item in own), default=0.0), "its own range take"
    if not own:
        readings, source = _by_slope(sensor, holding, layout), "measured angles"
    if not readings and holding:
        readings, source = _all_read(sensor, holding), "all that was read"
    moved = any(item.has_moved(sensor) for item in holding)
    if not moved and layout.counts is not None:
        readings, source = layout.counts[1] - layout.counts[0], "what the glove can send"
    readings = readings if moved or layout.counts is not None else 0.0
    return ActiveRange(sensor, readings, source, angle, moved)


def _by_slope(sensor: str, takes: Sequence[SmoothTake], layout: Layout) -> float:
    """Slope times the angles seen, of the take that saw most of them."""
    best = 0.0
    for item in takes:
        found, own = measured_slope(item, sensor, layout), item.angle(sensor)
        if found is not None and own is not None and abs(found[0]) > 3 * found[1]:
            best = max(best, abs(found[0]) * span(own))
    return best


def _all_read(sensor: str, takes: Sequence[SmoothTake]) -> float:
    """Widest of all takes: readings shift between wearings, so takes are not thrown together."""
    return max(span(item.reading(sensor)) for item in takes)


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
