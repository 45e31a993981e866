"""Reference angles that jump away while the sensors stand, and come back: a marker that swapped, a wild row.

A joint that moves is seen by the sensors. So a step of the reference from one row to the next is held against
what a line through all readings makes of it around that moment, and against the steps the reference usually
takes. What comes back is left out: it neither trains nor scores. A step that stays is told of, as nothing
says which side of it is right.

Tuned on flex gloves of 30 to 120 Hz with up to 5 % of wild rows, and on healthy simulated sessions, of which
no row may be left out (tests/models/test_reference_jumps.py has others).

What is suspicious about reference angles, in sentences for the person who imports them.

Angles written in radians are as small as radians while the sensors move by much. A joint that moves by 3
degrees has small angles too, so the sensors decide. A strain or bend sensor that changes by its whole reading
has turned by some 50 to 900 degrees in the recordings this was tried on; the same recordings in radians give
1 to 8.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from glovecal_models.takes.reading_faults import median_of_five
from glovecal_models.takes.take import ReferenceJump, Take

LEAST_JUMP_AWAY_DEG = 8.0
JUMP_SPREADS = 8.0
"""Times the robust spread of the steps that the readings do not show."""
TIMES_MOVED = 2.0
"""Times the largest step that the readings show within ``AROUND_S``."""
AROUND_S, AROUND_ROWS = 0.1, 2
LONGEST_S = 1.0
"""Away for longer, it may be the other side that is wrong."""
SHORT_S = 0.1
"""At an end of what was measured nothing comes back: only so much is left out there."""
BEFORE_ROWS = 5
"""Their median is where an angle leaves."""
BACK_SHARE, AT_ONCE_SHARE = 0.35, 0.6
"""Of the step away, so near to where it left; and of the way back, so much in one step."""
STAYS_S, STAYS_SHARE = 0.25, 0.6
"""A step stays where means over so long on its two sides differ by so much of it."""
GAP_S, GAP_ROWS = 0.1, 3.0
"""A longer pause of the reference, and one of more rows: the joint may have moved in it."""
FEWEST_JUMP_ROWS = 30
MOSTLY_HELD = 0.8
"""Share of the rows that repeat the one before: angles set one by one do jump."""
SHOWN_R2 = 0.5
"""Below, the readings hardly tell the angle: any sensor's motion is taken for the joint's."""
ROUNDS = 4
HUBER = 1.5
STILL_WITHIN_DEG = 0.5
"""A whole reference that stays within this has not moved: even a held hand trembles about as much."""


def reference_jumps(take: Take) -> tuple[ReferenceJump, ...]:
    """In the order of rotations and times; those that were left out of the take already come first."""
    found = [
        jump
        for column, rotation in enumerate(take.rotations)
        for jump in _jumps_of(take, rotation, take.reference[:, column])
    ]
    return (*take.excluded, *found)


def without_jumps(take: Take) -> Take:
    """The take without the angles that jump and come back; ``excluded`` keeps what they were. The same take
    where there are none."""
    found = [jump for jump in reference_jumps(take)[len(take.excluded) :] if jump.comes_back]
    if not found:
        return take
    reference = take.reference.copy()
    for jump in found:
        inside = (take.reference_time_s >= jump.start_s) & (take.reference_time_s <= jump.end_s)
        reference[inside, take.rotations.index(jump.rotation)] = np.nan
    return replace(take, reference=reference, excluded=(*take.excluded, *found))


def _jumps_of(take: Take, rotation: str, column: np.ndarray) -> Iterator[ReferenceJump]:
    rows = np.flatnonzero(np.isfinite(column))
    angle, time = column[rows], take.reference_time_s[rows]
    if len(rows) < FEWEST_JUMP_ROWS or np.abs(np.diff(angle)).max() <= LEAST_JUMP_AWAY_DEG:
        return
    if (np.diff(angle) == 0).mean() > MOSTLY_HELD:
        return
    readings = _at(take, time)
    shown, moved = _shown(readings, angle)
    rest = angle - shown
    steps = np.diff(rest)
    spread = 1.4826 * float(np.median(np.abs(steps - np.median(steps))))
    limit = max(LEAST_JUMP_AWAY_DEG, JUMP_SPREADS * spread) + TIMES_MOVED * _largest_near(time, moved)
    jumps = 1 + np.flatnonzero(np.abs(np.diff(angle)) > limit)
    pause = max(GAP_S, GAP_ROWS * float(np.median(np.diff(time))))
    ends = [0, *(1 + np.flatnonzero(np.diff(time) > pause)), len(time)]
    for begin, end in pairwise(ends):
        own = jumps[(jumps > begin) & (jumps < end)]
        for first, after, comes_back in _stretches(time, rest, own, limit, begin, end):
            before = first - 1 if first > begin else after
            size = float(np.abs(rest[first:after] - rest[min(before, len(rest) - 1)]).max())
            yield ReferenceJump(
                rotation, float(time[first]), float(time[after - 1]), after - first, size, comes_back
            )


def _stretches(
    time: np.ndarray, rest: np.ndarray, jumps: np.ndarray, limit: np.ndarray, begin: int, end: int
) -> Iterator[tuple[int, int, bool]]:
    """First row, the row after the last, and whether the angle comes back; of a stretch of rows without a
    pause. ``limit`` (N - 1,) is that of each step."""
    free = begin
    sound = np.ones(len(rest), dtype=bool)
    for at in jumps:
        if at < free or (at == free and free > begin):
            continue
        before = np.flatnonzero(sound[begin:at])[-BEFORE_ROWS:] + begin
        left = float(np.median(rest[before]))
        if len(before) >= AROUND_ROWS and abs(rest[at] - left) < BACK_SHARE * abs(rest[at] - rest[at - 1]):
            continue  # the way back from a smaller step
        latest = int(np.searchsorted(time[:end], time[at] + LONGEST_S, side="right"))
        back = _comes_back(rest[:latest], at, left, float(limit[at - 1]))
        if back is not None:
            yield int(at), back, True
            free, sound[at:back] = back, False
        elif free == begin and at - begin <= end - at and time[at - 1] - time[begin] <= SHORT_S:
            yield begin, int(at), True
            free = at
        elif time[end - 1] - time[at] <= SHORT_S:
            yield int(at), end, True
            return
        elif _stays(rest, at, max(AROUND_ROWS + 1, round(STAYS_S / float(np.median(np.diff(time))))), end):
            yield int(at), int(at) + 1, False
            free = at


def _comes_back(rest: np.ndarray, at: int, left: float, limit: float) -> int | None:
    """The first row that is near where the angle ``left`` at ``at``, and came there at once."""
    away = np.abs(rest[at:] - left)
    near = away[1:] <= max(0.5 * LEAST_JUMP_AWAY_DEG, min(BACK_SHARE * float(away[0]), limit))
    at_once = np.abs(np.diff(rest[at:])) >= AT_ONCE_SHARE * away[:-1]
    if not near.any():
        return None
    first = int(np.argmax(near))
    return at + 1 + first if at_once[first] else None


def _stays(rest: np.ndarray, at: int, rows: int, end: int) -> bool:
    before, after = rest[max(at - rows, 0) : at], rest[at : min(at + rows, end)]
    size = abs(rest[at] - rest[at - 1])
    return abs(float(np.median(after) - np.median(before))) >= STAYS_SHARE * size


def _at(take: Take, time: np.ndarray) -> np.ndarray:
    """(R, S) readings at the reference's times."""
    return np.column_stack([np.interp(time, take.time_s, column) for column in take.readings.T])


def _shown(readings: np.ndarray, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N,) the angle that a line through the readings shows, without single wild readings, and (N - 1,) how
    far it moved from row to row."""
    smooth = np.column_stack([_without_spikes(column) for column in readings.T])
    spans = np.ptp(smooth, axis=0)
    alive = spans > 0
    columns = np.column_stack([np.ones(len(angle)), (smooth - smooth.mean(axis=0))[:, alive] / spans[alive]])
    weight = np.ones(len(angle))
    fitted = np.full(len(angle), np.median(angle))
    for _ in range(ROUNDS):
        root = np.sqrt(weight)
        fitted = columns @ np.linalg.lstsq(columns * root[:, None], angle * root, rcond=None)[0]
        away = np.abs(angle - fitted)
        usual = max(1.4826 * float(np.median(away)), 1e-9)
        weight = 1.0 / np.maximum(away / (HUBER * usual), 1.0)
    moved = np.abs(np.diff(fitted))
    low, high = np.quantile(angle, (0.02, 0.98))
    whole = float(np.median(np.abs(angle - np.median(angle))))
    if whole > 0 and 1.0 - (float(np.median(np.abs(angle - fitted))) / whole) ** 2 < SHOWN_R2 and alive.any():
        share = (np.abs(np.diff(smooth, axis=0))[:, alive] / spans[alive]).max(axis=1)
        moved = np.maximum(moved, share * float(high - low))
    return fitted, moved


def _without_spikes(values: np.ndarray) -> np.ndarray:
    return median_of_five(np.pad(values, 2, mode="edge"))


def _largest_near(time: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """(N - 1,) the largest of ``moved`` within ``AROUND_S`` of each step."""
    from scipy.ndimage import maximum_filter1d  # slow to load, and every recording loads this file

    rows = max(AROUND_ROWS, round(AROUND_S / max(float(np.median(np.diff(time))), 1e-9)))
    return maximum_filter1d(moved, 2 * rows + 1, mode="nearest")


MOST_TIMES = 4


def jump_sentences(take: Take, jumps: Sequence[ReferenceJump]) -> list[str]:
    """One for all angles that come back, one for each step that stays."""
    who, away = f"Take {take.name!r}", [jump for jump in jumps if jump.comes_back]
    sentences = []
    if away:
        times = sorted(jump.start_s for jump in away)
        at = ", ".join(f"{each:.2f}" for each in times[:MOST_TIMES])
        more = ", ..." * (len(times) > MOST_TIMES)
        each = [
            f"{name} {sum(jump.rows for jump in away if jump.rotation == name)}"
            for name in dict.fromkeys(jump.rotation for jump in away)
        ]
        sentences.append(
            f"{who}: reference angles jump away and back while the sensors do not, by up to"
            f" {max(jump.size_deg for jump in away):.0f} degrees (at {at}{more} s; take check lists all)."
            f" Excluded from training and errors: {', '.join(each)}."
        )
    return sentences + [
        f"{who}: the reference of {jump.rotation} steps by {jump.size_deg:.0f} degrees at {jump.start_s:.2f}"
        " s while the sensors do not, and stays. Did a marker swap?"
        for jump in jumps
        if not jump.comes_back
    ]


def reference_warnings(take: Take) -> list[str]:
    """Sentences about a reference that can be imported but hardly teaches; none for a take without one."""
    if not take.rotations:
        return []
    who = f"Take {take.name!r}"
    warnings = []
    spans = [_span(take.reference[:, index]) for index in range(len(take.rotations))]
    if max(spans) < STILL_WITHIN_DEG:
        warnings.append(
            f"{who}: the reference never moves (no rotation changes by more than {max(spans):.2g} degrees), "
            "so it can teach one pose at most. Was the tracker frozen?"
        )
    paired = frames_with_reference(take)
    if not paired.any():
        warnings.append(
            f"{who}: no frame has a reference (frames from {take.start_s:g} to {take.time_s[-1]:g} s, "
            f"reference from {take.reference_time_s[0]:g} to {take.reference_time_s[-1]:g} s). "
            "Are the two clocks different?"
        )
    elif paired.mean() < 0.5:
        warnings.append(f"{who}: only {100 * paired.mean():.0f} % of the frames have a reference.")
    return warnings


def frames_with_reference(take: Take) -> np.ndarray:
    """(N,) whether anything was measured at each frame that was asked for; the pre-roll is not counted."""
    angles = take.reference_at_frames(take.rotations)[take.pre_roll_frames :]
    return np.any(np.isfinite(angles), axis=1)


def _span(values: np.ndarray) -> float:
    measured = values[np.isfinite(values)]
    return float(measured.max() - measured.min()) if len(measured) else 0.0


LARGEST_RADIANS = 3.5
"""A little over pi."""
LEAST_SPAN = 0.2
"""Below this even radians are a small motion (11 degrees)."""
LEAST_SENSOR_MOTION = 0.06
"""Share of a sensor's largest reading."""
MOST_PER_READING = 10.0
"""Angle spans beyond this many units per whole reading of the sensor are degrees."""
WITHOUT_EXTREMES = (0.02, 0.98)
"""Quantiles between which motion is measured: a held hand's noise reaches far at its extremes."""
FEWEST_ROWS = 30
SURE_CORRELATION = 0.5


def radians_problem(takes: Sequence[Take]) -> str | None:
    """A sentence if the reference angles of ``takes`` together look like radians, else None."""
    measured = [take for take in takes if np.isfinite(take.reference).any()]
    values = np.concatenate([np.empty(0), *(take.reference.ravel() for take in measured)])
    values = values[np.isfinite(values)]
    if not len(values) or np.abs(values).max() > LARGEST_RADIANS:
        return None
    if (values == np.round(values)).all():  # 0 for a flat hand, 1 for a fist: names of poses, not angles
        return None
    found = [item for take in measured if (item := _motion(take)) is not None]
    if not found:
        return None
    span, share, sensor = max(found)
    return (
        f"no reference angle spans more than {span:.2f} while sensor {sensor} moves by {100 * share:.0f} %"
        " of its largest reading: these look like radians. Angles are wanted in degrees; multiply by 57.2958."
    )


def _motion(take: Take) -> tuple[float, float, str] | None:
    """Largest angle span, and share and name of the sensor that moved too much for degrees; None without."""
    angles = take.reference_at_frames(take.rotations)
    rows = np.isfinite(angles).any(axis=1)
    if rows.sum() < FEWEST_ROWS:
        return None
    angles, readings = angles[rows], take.readings[rows]
    measured = np.isfinite(angles).any(axis=0)
    low, high = np.nanquantile(angles[:, measured], WITHOUT_EXTREMES, axis=0)
    span = float((high - low).max())
    largest = np.abs(readings).max(axis=0)
    low, high = np.quantile(readings, WITHOUT_EXTREMES, axis=0)
    motion = (high - low) / np.where(largest > 0, largest, 1.0)
    # a reading around zero says nothing on the sensor's range: there noise must not count as motion
    tared = (readings.min(axis=0) < 0) & (readings.max(axis=0) > 0)
    moves = motion > LEAST_SENSOR_MOTION
    moves &= ~tared | (_correlation(readings, angles[:, measured]) > SURE_CORRELATION)
    if span <= LEAST_SPAN or not moves.any():
        return None
    sensor = int(np.argmax(np.where(moves, motion, -1.0)))
    if span > MOST_PER_READING * motion[sensor]:
        return None
    return span, float(motion[sensor]), take.sensors[sensor]


def _correlation(readings: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """(S,) the largest correlation, in size, of each sensor with any rotation."""
    best = np.zeros(readings.shape[1])
    for values in angles.T:
        known = np.isfinite(values)
        x = readings[known] - readings[known].mean(axis=0)
        y = values[known] - values[known].mean()
        norm = np.linalg.norm(x, axis=0) * np.linalg.norm(y)
        size = np.abs(x.T @ y) / np.where(norm > 0, norm, 1.0)
        best = np.maximum(best, size)
    return best
