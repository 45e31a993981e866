"""A take looked at before it is trusted: its rhythm, what each sensor did, what was measured, what is odd."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_models.takes.dead_sensor import dead_sensors
from glovecal_models.takes.frame_times import time_unit_warning
from glovecal_models.takes.reference_check import frames_with_reference, radians_problem, reference_warnings
from glovecal_models.takes.reference_jumps import jump_sentences, reference_jumps
from glovecal_models.takes.take import ReferenceJump, Take

GAP_INTERVALS = 2.5
"""An interval longer than this many median ones is a gap: at least one frame in between is missing."""
MOSTLY_REPEATED = 0.5
"""From this share of repeated frames on, the readings are older than their time stamps say. A hand held
still repeats 8-bit frames too, so a smaller share says nothing."""


@dataclass(frozen=True)
class SensorRange:
    """What one sensor did; ``changed`` is the share of frames whose reading differs from the one before."""

    sensor: str
    low: float
    high: float
    changed: float


@dataclass(frozen=True)
class RotationRange:
    """What was measured of one rotation, degrees; ``rows`` are the reference rows that have it."""

    rotation: str
    rows: int
    low_deg: float
    high_deg: float


@dataclass(frozen=True)
class TakeCheck:
    """Facts about a take, and ``sentences`` on what looks wrong (none when nothing does)."""

    rate_hz: float | None
    """Frames a second by the median interval; None for a single frame."""
    gaps: int
    longest_interval_s: float | None
    repeated_frames: float
    """Share of frames that are the same as the one before in every sensor."""
    frames_with_reference: float
    """Share of the frames after the pre-roll that have at least one reference angle."""
    pre_roll_frames: int
    pre_roll_s: float
    """Frames, and seconds, recorded before the take was asked for."""
    sensors: tuple[SensorRange, ...]
    rotations: tuple[RotationRange, ...]
    jumps: tuple[ReferenceJump, ...]
    """Where the reference jumps while the sensors do not."""
    sentences: tuple[str, ...]


def check_take(take: Take) -> TakeCheck:
    """Look at a take with at least one frame."""
    intervals = np.diff(take.time_s)
    typical = float(np.median(intervals)) if len(intervals) else None
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
    if repeated >= MOSTLY_REPEATED:
        warnings.append(
            f"{who}: {100 * repeated:.0f} % of the frames repeat the one before; did the hand hold still, "
            "or does the glove measure more slowly than it was recorded?"
        )
    return warnings
