"""A take looked at before it is trusted: its rhythm, what each sensor did, what was measured, what is odd.

Sensors that say nothing of the hand: still, trembling by one count, or pressed against an end stop.

What looks wrong about takes before anything is learned from them; like warnings are counted.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.presentation.document import answer
from glovecal_models.takes.channel_faults import ChannelFault, channel_faults
from glovecal_models.takes.raw_table import time_unit_warning
from glovecal_models.takes.reference_jumps import (
    frames_with_reference,
    jump_sentences,
    radians_problem,
    reference_jumps,
    reference_warnings,
)
from glovecal_models.takes.take import ReferenceJump, Take

FEWEST_FRAMES = 20
"""With fewer, two values or a repeated end say nothing."""
MOSTLY = 0.8
"""Share of the frames at one end of the range from which on a sensor is clipped."""
MOVES_MEANWHILE = 0.5
"""Share of its joint's range through which the reference goes while the sensor stays at its end; without a
reference, share of those frames in which another sensor changes. Less, and the hand rested."""
GAP_INTERVALS = 2.5
"""An interval longer than this many median ones is a gap: at least one frame in between is missing."""
MOSTLY_REPEATED = 0.5
"""From this share of repeated frames on, the readings are older than their time stamps say. A hand held
still repeats 8-bit frames too, so a smaller share says nothing."""
_NAME = re.compile(r"^Take (['\"]).*?\1")
_NUMBER = re.compile(r"[0-9]+(\.[0-9]+)?(e[-+]?[0-9]+)?")


@dataclass(frozen=True)
class DeadSensor:
    """``why``: "always 7", "only 7 or 8", or "at its end stop 255 in 93 % of the frames"."""

    sensor: str
    why: str

    def __str__(self) -> str:
        return f"{self.sensor} ({self.why})"


def dead_sensors(takes: Sequence[Take], sensors: Sequence[str]) -> tuple[DeadSensor, ...]:
    """Those of ``sensors`` that are dead or clipped over all takes; every take has them all."""
    columns = {name: np.concatenate([_column(take, name) for take in takes]) for name in sensors}
    steps = [np.diff(np.unique(values)) for values in columns.values()]
    count = min((float(step.min()) for step in steps if len(step)), default=0.0)
    found = ((name, _why(name, values, takes, count)) for name, values in columns.items())
    return tuple(DeadSensor(name, why) for name, why in found if why is not None)


def _why(name: str, values: np.ndarray, takes: Sequence[Take], count: float) -> str | None:
    low, high = float(values.min()), float(values.max())
    if low == high:
        return f"always {low + 0.0:g}"
    if len(values) < FEWEST_FRAMES:
        return None
    if high - low <= 1.001 * count:
        return f"only {low + 0.0:g} or {high + 0.0:g}"
    end = high if np.mean(values == high) > np.mean(values == low) else low
    share = float(np.mean(values == end))
    if share < MOSTLY or not _moves_meanwhile(name, takes, end):
        return None
    return f"at its end stop {end + 0.0:g} in {100 * share:.0f} % of the frames"


def _moves_meanwhile(name: str, takes: Sequence[Take], end: float) -> bool:
    angles = np.concatenate([take.reference_at_frames([name])[:, 0] for take in takes])
    at_end = np.concatenate([_column(take, name) == end for take in takes])
    known = np.isfinite(angles)
    if (known & at_end).any():
        return bool(np.ptp(angles[known & at_end]) > MOVES_MEANWHILE * np.ptp(angles[known]))
    others = np.concatenate([_others_change(take, name) for take in takes])
    return bool(others[at_end].mean() > MOVES_MEANWHILE)


def _others_change(take: Take, name: str) -> np.ndarray:
    """(N,) whether any other sensor reads something else than in the frame before."""
    rest = np.delete(take.readings, take.sensors.index(name), axis=1)
    return np.append(False, (np.diff(rest, axis=0) != 0).any(axis=1))[: len(rest)]


def _column(take: Take, name: str) -> np.ndarray:
    return take.readings[:, take.sensors.index(name)]


@answer
class SensorRange:
    """What one sensor did."""

    sensor: str
    low: float
    high: float
    changed: float
    """Share of frames whose reading differs from the one before."""


@answer
class RotationRange:
    """What was measured of one rotation, degrees."""

    rotation: str
    rows: int
    """Reference rows that have it."""
    low_deg: float
    high_deg: float


@dataclass(frozen=True)
class TakeCheck:
    """Facts about a take, and ``sentences`` on what looks wrong (none when nothing does)."""

    rate_hz: float | None
    """Frames a second by the median interval; None for a single frame."""
    gaps: int
    """Intervals in which frames are missing."""
    longest_interval_s: float | None
    repeated_frames: float
    """Share of frames that are the same as the one before in every sensor."""
    frames_with_reference: float
    """Share of the frames after the pre-roll that have at least one reference angle."""
    pre_roll_frames: int
    """Recorded before the take was asked for."""
    pre_roll_s: float
    sensors: tuple[SensorRange, ...]
    rotations: tuple[RotationRange, ...]
    jumps: tuple[ReferenceJump, ...]
    """Where the reference jumps while the sensors do not."""
    sentences: tuple[str, ...]
    """What looks wrong."""


def check_take(take: Take) -> TakeCheck:
    """Look at a take with at least one frame."""
    intervals = np.diff(take.time_s)
    typical = float(np.median(intervals)) if len(intervals) else None
    intervals[take.left_out_intervals] = typical  # nothing was lost there
    gaps = 0 if typical is None else int((intervals > GAP_INTERVALS * typical).sum())
    changed = take.readings[1:] != take.readings[:-1]
    repeated = float((~changed.any(axis=1)).mean()) if len(changed) else 0.0
    sensors = tuple(_sensor(take, index, changed[:, index]) for index in range(len(take.sensors)))
    jumps = reference_jumps(take)
    return TakeCheck(
        rate_hz=None if typical is None else 1.0 / typical,
        gaps=gaps,
        longest_interval_s=float(intervals.max()) if len(intervals) else None,
        repeated_frames=repeated,
        frames_with_reference=float(frames_with_reference(take).mean()),
        pre_roll_frames=take.pre_roll_frames,
        pre_roll_s=take.start_s - float(take.time_s[0]),
        sensors=sensors,
        rotations=tuple(
            item for index in range(len(take.rotations)) if (item := _rotation(take, index)) is not None
        ),
        jumps=jumps,
        sentences=(
            *_frame_warnings(take, intervals, gaps, repeated, sensors),
            *reference_warnings(take),
            *_radians(take),
            *jump_sentences(take, jumps),
        ),
    )


def _radians(take: Take) -> tuple[str, ...]:
    found = radians_problem([take])
    return () if found is None else (f"Take {take.name!r}: {found}",)


def _sensor(take: Take, index: int, changed: np.ndarray) -> SensorRange:
    readings = take.readings[:, index]
    share = float(changed.mean()) if len(changed) else 0.0
    return SensorRange(take.sensors[index], float(readings.min()), float(readings.max()), share)


def _rotation(take: Take, index: int) -> RotationRange | None:
    angles = take.reference[:, index]
    angles = angles[np.isfinite(angles)]
    if not len(angles):
        return None
    return RotationRange(take.rotations[index], len(angles), float(angles.min()), float(angles.max()))


def _frame_warnings(
    take: Take, intervals: np.ndarray, gaps: int, repeated: float, sensors: tuple[SensorRange, ...]
) -> list[str]:
    who, warnings = f"Take {take.name!r}", []
    wrong_unit = time_unit_warning(float(np.median(intervals))) if len(intervals) else None
    if wrong_unit:
        warnings.append(f"{who}: {wrong_unit}")
    if gaps:
        longest = int(intervals.argmax())
        warnings.append(
            f"{who}: {gaps} gap{'s' if gaps > 1 else ''} in the frames, the longest of "
            f"{intervals[longest]:.3g} s at {take.time_s[longest]:g} s."
        )
    dead = dead_sensors([take], take.sensors) if len(take.time_s) > 1 else ()
    if dead:
        named = ", ".join(map(str, dead))
        warnings.append(f"{who}: sensors that say nothing of the hand: {named}. Is a wire broken?")
    warnings += [f"{who}: {each}. {each.remedy}" for each in channel_faults(take)]
    if repeated >= MOSTLY_REPEATED:
        warnings.append(
            f"{who}: {100 * repeated:.0f} % of the frames repeat the one before; did the hand hold still, "
            "or does the glove measure more slowly than it was recorded?"
        )
    return warnings


def take_warnings(takes: Sequence[Take]) -> list[str]:
    """The sentences of ``check_take``; of those that differ in numbers alone the first, and how many more."""
    return alike_once([each for take in takes if len(take.time_s) for each in check_take(take).sentences])


def sensor_sentences(faults: Sequence[tuple[Take, ChannelFault]]) -> list[str]:
    """What is wrong with sensors, that joints did not do; of several takes the first, and how many more."""
    return alike_once([f"Take {take.name!r}: {fault}. {fault.remedy}" for take, fault in faults])


def excluded_sentences(takes: Sequence[Take]) -> list[str]:
    """On reference angles that are excluded, as they jump away and come back, and on what people left out."""
    jumps = [each for take in takes for each in jump_sentences(take, take.excluded)]
    return alike_once(jumps) + [left_out_sentence(take) for take in takes if take.left_out]


def left_out_sentence(take: Take) -> str:
    """Which stretches of it a person left out."""
    stretches = ", ".join(f"{low:.2f} to {high:.2f} s" for low, high in take.left_out_since_start)
    return f"Take {take.name!r}: left out by hand: {stretches}."


def alike_once(sentences: Sequence[str]) -> list[str]:
    """Of those that differ in numbers alone the first, and how many more."""
    alike: dict[str, list[str]] = {}
    for sentence in sentences:
        alike.setdefault(kind_of(sentence), []).append(sentence)
    return [_summarized(some) for some in alike.values()]


def kind_of(sentence: str) -> str:
    """The same text for warnings that differ in the take's name and in numbers alone."""
    return _NUMBER.sub("#", _NAME.sub("", sentence)).replace("gaps", "gap").replace("takes", "take")


def _summarized(sentences: Sequence[str]) -> str:
    more = len(sentences) - 1
    return (
        sentences[0] if not more else f"{sentences[0]} The same in {more} more take{'s' if more > 1 else ''}."
    )
