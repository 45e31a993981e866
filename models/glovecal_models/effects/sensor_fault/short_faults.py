"""Faults too short or too small to show in the readings alone; the reference tells what should have come.

A loose contact holds a value for some frames, or pulls it away and lets go, many times in a session. Each one
alone might be chance or an odd movement, so they count only when there are several of them.

All work on the readings (N,) of one sensor in one take and give a mask (N,) of the frames concerned;
``expected`` (N,) are the readings that the reference asks for, NaN where there is none.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.takes.reading_faults import (
    GRADUAL_SHARE,
    MADE_SHARE,
    SHOWN_WITHIN_S,
    constant_runs,
    median_of_five,
    smallest_step,
)

FEWEST = 3
"""Of either kind, in all takes together."""
LEAST_OF_RANGE = (0.5, 99.5)
SHORT_STUCK_FRAMES, SHORT_STUCK_S = 6, 0.08
STUCK_STEPS = 3.0
"""Of the converter: the reference must ask for so much more or less while a value stays."""
STUCK_DEG = 3.0
SMOOTHED = 5
RELEASED_SHARE = 0.5
"""A sensor that lets go makes up for this much at once; friction lets go without a jump."""
RELEASED_OVER = 99.5
"""Percentile of the sensor's other steps against the reference that letting go must exceed: cloth of many
small switches stands and jumps all the time."""
DROPOUT_S = 0.5
DROPOUT_FRAMES = 3
"""At least; what is shorter is a spike."""
DROPOUT_SHARE = 0.05
"""Of the range."""
DROPOUT_SPREADS = 8.0
"""Times the robust spread of a frame's change against the reference."""
BEFORE_FRAMES = 5
SHOWN_IN_READING = 0.5
"""Of a jump against the reference, which the reading's own jump must be: else the reference jumps."""
ALIKE = 0.5
"""The jump back is between this share of the jump away and its inverse."""


def expected_readings(readings: np.ndarray, angles: np.ndarray) -> tuple[np.ndarray, float]:
    """What a straight line makes of the reference (N,), and its counts per degree; NaN and 0 without one."""
    known = np.isfinite(angles)
    if known.sum() < 100 or np.ptp(angles[known]) < STUCK_DEG:
        return np.full(len(readings), np.nan), 0.0
    gain, offset = straight_line(angles[known], readings[known])
    return gain * angles + offset, abs(gain)


def as_large_as_readings(angles: np.ndarray, low: float, high: float) -> np.ndarray:
    """The reference (N,) scaled to the range of the readings; NaN without one.

    For sizes of movements alone: unlike a line through both, it is as large where the sensor trails.
    """
    known = np.isfinite(angles)
    if known.sum() < 100:
        return np.full(len(angles), np.nan)
    least, most = np.percentile(angles[known], LEAST_OF_RANGE)
    return (
        angles * (high - low) / (most - least) if most - least > STUCK_DEG else np.full(len(angles), np.nan)
    )


def straight_line(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """Slope, and value at zero, of the line that fits ``y`` best; ``x`` must not all be the same.
    ``np.polyfit`` takes ten times as long."""
    centre = float(x.mean())
    away = x - centre
    slope = float(away @ y) / float(away @ away)
    return slope, float(y.mean()) - slope * centre


def shortly_stuck(
    time_s: np.ndarray,
    readings: np.ndarray,
    low: float,
    high: float,
    expected: np.ndarray,
    gain: float,
    others_move: np.ndarray,
) -> np.ndarray:
    """Runs of one value, then a jump to where the reference went; ``others_move`` (N,): no repeated frame.

    ``low`` and ``high`` are the sensor's range, ``gain`` its counts per degree.
    """
    from scipy.ndimage import uniform_filter1d  # slow to load, and every model with effects loads this file

    found = np.zeros(len(readings), dtype=bool)
    margin = GRADUAL_SHARE * (high - low)
    start, end = constant_runs(readings)
    start, end = start[end < len(readings)], end[end < len(readings)]
    long = (end - start >= SHORT_STUCK_FRAMES) & (time_s[end] - time_s[start] >= SHORT_STUCK_S)
    within = (low + margin < readings[start]) & (readings[start] < high - margin)
    start, end = start[long & within], end[long & within]
    if not len(start):
        return found
    smooth = uniform_filter1d(expected, SMOOTHED)
    least = max(STUCK_STEPS * smallest_step(readings), STUCK_DEG * gain)
    asked = smooth[end] - smooth[start]
    possible = np.flatnonzero(np.abs(asked) > least)
    if not len(possible):
        return found
    steps = np.abs(np.diff(readings - smooth, prepend=np.nan))
    elsewhere = np.isfinite(steps)
    elsewhere[end[possible]] = False
    usual = float(np.percentile(steps[elsewhere], RELEASED_OVER)) if elsewhere.any() else 0.0
    for first, after, missing in zip(start[possible], end[possible], asked[possible], strict=True):
        released = readings[after] - readings[after - 1]
        found[first:after] = (
            others_move[first + 1 : after].mean() > 0.5
            and released / missing > RELEASED_SHARE
            and steps[after] > usual
        )
    return found


def small_dropouts(
    time_s: np.ndarray,
    readings: np.ndarray,
    span: float,
    expected: np.ndarray,
    asked: np.ndarray,
    others_move: np.ndarray,
) -> np.ndarray:
    """Pieces of three frames to half a second that stand off, entered and left by jumps of about one size.

    ``span`` is the sensor's range in readings; ``asked`` (N,) the reference as large as the readings, which
    tells the joint's own movements; ``others_move`` (N,): no repeated frame.
    """
    found = np.zeros(len(readings), dtype=bool)
    change = np.diff(readings - expected, prepend=np.nan)
    known = np.isfinite(change)
    if span <= 0 or known.sum() < 100:
        return found
    change[~known] = 0.0
    # No change stands out from a median of its neighbours by more than all of them span.
    if float(np.ptp(change)) <= DROPOUT_SHARE * span:
        return found
    fresh = others_move | (np.diff(readings, prepend=np.nan) != 0)
    # A movement that the line does not explain lasts; only what stands out from its neighbours is a jump.
    jump = change - median_of_five(np.pad(change, 2, mode="symmetric"))
    spread = 1.4826 * float(np.median(np.abs(jump[known])))
    limit = max(DROPOUT_SPREADS * spread, 4.0 * smallest_step(readings), DROPOUT_SHARE * span)
    own = np.diff(readings, prepend=readings[:1])
    own -= median_of_five(np.pad(own, 2, mode="symmetric"))
    shown = own * np.sign(jump) >= SHOWN_IN_READING * np.abs(jump)
    shown &= _quickest_asked(time_s, asked) < MADE_SHARE * np.abs(jump)
    places = 1 + np.flatnonzero((np.abs(jump) > limit)[1:] & shown[1:])
    level = np.cumsum(change)
    at = 0
    while at + 1 < len(places):
        away, back = places[at], places[at + 1]
        share = -jump[back] / jump[away]
        if not (ALIKE < share < 1.0 / ALIKE and time_s[back] - time_s[away] <= DROPOUT_S):
            at += 1
            continue
        # Against the frames before, of which a small spike may have moved one.
        before = np.median(level[max(away - BEFORE_FRAMES, 0) : away])
        held = float(np.median(level[away:back]) - before) / jump[away]
        lasts = back - away >= DROPOUT_FRAMES
        found[away:back] = lasts and held > ALIKE and fresh[away + 1 : back].mean() > 0.5
        # Both jumps are used up, by a spike too: its way back is not the beginning of a dropout.
        at += 2 if not lasts or held > ALIKE else 1
    return found


def _quickest_asked(time_s: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """(N,): the largest step that ``asked`` makes around each frame, beyond a movement that lasts."""
    from scipy.ndimage import maximum_filter1d  # slow to load, as above

    steps = np.nan_to_num(np.diff(asked, prepend=asked[:1]))
    steps -= median_of_five(np.pad(steps, 2, mode="symmetric"))
    around = round(SHOWN_WITHIN_S / float(np.median(np.diff(time_s))))
    return maximum_filter1d(np.abs(steps), 2 * around + 1)
