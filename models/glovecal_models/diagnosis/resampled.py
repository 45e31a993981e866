"""Takes on even times, readings and reference smoothed alike.

Which effect is missing is decided on signals that went through the same symmetric window: unsmoothed, every
operator that averages (a small play, a low pass) gains merely by removing noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.effects.base.dynamics import LONGEST_GAP_S
from glovecal_models.takes.take import KnownLatency, Take

RATE_HZ = 50.0
WINDOW_S = 0.05
SMOOTHING = 13
"""Even times, of the signals that effects are judged on."""
FEWEST_STEPS = 8
"""Between frames of all takes; fewer do not tell a movement from single poses."""
SHORTEST_BRIDGE_S = 0.1
"""Frames so close are always taken for a movement."""
BRIDGED_INTERVALS = 2.5
"""Longer is a gap, as when a take is checked: a frame is missing."""
ALIKE_NEIGHBOURS = 0.25
"""Variance of steps between neighbouring frames, over that between frames drawn at random (median sensor),
up to which a movement was recorded. At 9 Hz free motion of simulated hands has 0.01, two people walking 0.08
and 0.11, five ankles 0.04 to 0.17; at 5 Hz 0.04, 0.18 to 0.27 and 0.11 to 0.41, the quickest of which are as
unlike as poses. A robot hand set to one pose after another has 0.42, in a random order 0.83."""


@dataclass(frozen=True)
class ResampledTake:
    """N even times of one take."""

    name: str
    wearing: str
    time_s: np.ndarray
    """(N,), seconds on the frames' clock."""
    readings: np.ndarray
    """(N, S), raw counts, in the order asked for."""
    reference: np.ndarray
    """(N, R), degrees, NaN where not measured."""
    context: dict[str, np.ndarray]
    """(N,) each, NaN where unknown."""
    is_sparse: bool = False
    """Single frames, too far apart for anything between them to be known: left as they are."""
    glove_latency: KnownLatency | None = None
    reference_sd: np.ndarray | None = None
    """(N, R), stated standard deviations, degrees; NaN where none is stated. None: the take states none."""


def bridge_s(takes: Sequence[Take]) -> float:
    """The longest time between two frames, seconds, over which straight lines are drawn.

    It follows the takes' own rate where their frames go on from one another, judged by all takes together: a
    take in which nothing moves tells nothing. Single poses, and frames further apart than what remembers can
    bear, are not bridged.
    """
    steps = np.concatenate([np.diff(take.time_s) for take in takes])
    interval = float(np.median(steps)) if len(steps) else 0.0
    longest = BRIDGED_INTERVALS * interval
    if longest <= SHORTEST_BRIDGE_S or interval > LONGEST_GAP_S or not _go_on(takes):
        return SHORTEST_BRIDGE_S
    return longest


def _go_on(takes: Sequence[Take]) -> bool:
    """Whether neighbouring frames are alike, compared with random pairs."""
    names = takes[0].sensors
    readings = [take.readings[:, [take.sensors.index(name) for name in names]] for take in takes]
    variance = np.concatenate(readings).var(axis=0)
    steps = np.concatenate([np.diff(part, axis=0) for part in readings])
    moves = variance > 0
    if len(steps) < FEWEST_STEPS or not moves.any():
        return False
    share = np.mean(steps[:, moves] ** 2, axis=0) / (2 * variance[moves])
    return float(np.median(share)) <= ALIKE_NEIGHBOURS


def resampled(
    take: Take, sensors: Sequence[str], rotations: Sequence[str], bridge_s: float = SHORTEST_BRIDGE_S
) -> ResampledTake:
    """``bridge_s``: the longest time between two frames across which a straight line is drawn."""
    if len(take.time_s) < 2 or float(np.median(np.diff(take.time_s))) > bridge_s:
        return _sparse(take, sensors, rotations)
    count = max(int(take.duration_s * RATE_HZ) + 1, 1)
    time = take.time_s[0] + np.arange(count) / RATE_HZ
    index = [take.sensors.index(name) for name in sensors]
    readings = _windowed(time, take.time_s, take.readings[:, index], bridge_s)
    reference = np.full((count, len(rotations)), np.nan)
    deviations = None if take.reference_sd is None else np.full_like(reference, np.nan)
    for column, rotation in enumerate(rotations):
        if rotation in take.rotations:
            values = take.reference[:, take.rotations.index(rotation)]
            known = np.isfinite(values)
            if known.sum() > 1:
                at = take.reference_time_s[known]
                reference[:, column] = _windowed(time, at, values[known, None], bridge_s)[:, 0]
            if deviations is not None and take.reference_sd is not None:
                # What was seen and not accepted is a gap, however short: nothing is drawn across it.
                reference[np.isnan(take.reference_between(time, values)), column] = np.nan
                stated = take.reference_sd[:, take.rotations.index(rotation)]
                deviations[:, column] = take.reference_between(time, stated)
    if take.begins_s is not None:
        reference[time < take.begins_s] = np.nan
    context = {name: _carried(time, take.time_s, values) for name, values in take.context.items()}
    read = np.isfinite(readings).all(axis=1)
    return ResampledTake(
        take.name, take.wearing, time[read], readings[read], reference[read],
        {name: values[read] for name, values in context.items()}, glove_latency=take.glove_latency,
        reference_sd=None if deviations is None else deviations[read],
    )  # fmt: skip


def _sparse(take: Take, sensors: Sequence[str], rotations: Sequence[str]) -> ResampledTake:
    readings = take.readings[:, [take.sensors.index(name) for name in sensors]]
    reference = take.reference_at_frames(rotations)
    return ResampledTake(
        take.name, take.wearing, take.time_s, readings, reference, dict(take.context), is_sparse=True,
        reference_sd=take.reference_sd_at_frames(rotations),
    )  # fmt: skip


def shifted(take: ResampledTake, delay_s: float) -> ResampledTake:
    """The take with its reference ``delay_s`` later, as readings that come so late ask for."""
    at = take.time_s - delay_s

    def moved(table: np.ndarray) -> np.ndarray:
        return np.column_stack([np.interp(at, take.time_s, column, np.nan, np.nan) for column in table.T])

    deviations = None if take.reference_sd is None else moved(take.reference_sd)
    return replace(take, reference=moved(take.reference), reference_sd=deviations)


def smoothed(take: ResampledTake, width: int) -> ResampledTake:
    """Readings and reference both through a Hann window of ``width`` (odd) even times."""
    if take.is_sparse or len(take.time_s) <= width:
        return take
    window = np.hanning(width + 2)[1:-1]
    return replace(
        take,
        readings=_through(take.readings, window / window.sum()),
        reference=_through(take.reference, window / window.sum()),
    )


def _through(values: np.ndarray, window: np.ndarray) -> np.ndarray:
    half = len(window) // 2
    padded = np.pad(values, ((half, half), (0, 0)), mode="edge")
    return np.column_stack([np.convolve(column, window, "valid") for column in padded.T])


def _windowed(at: np.ndarray, time: np.ndarray, values: np.ndarray, bridge_s: float) -> np.ndarray:
    """Means of ``values`` within half a window of each time; straight lines where none lie there.

    A straight line through the window's times would do the same to a line, so no delay comes in.
    NaN outside the recording and within longer gaps.
    """
    low = np.searchsorted(time, at - 0.5 * WINDOW_S - 1e-9)
    high = np.searchsorted(time, at + 0.5 * WINDOW_S + 1e-9)
    sums = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    times = np.concatenate([[0.0], np.cumsum(time)])
    count = np.maximum(high - low, 1)
    centre = np.where(high > low, (times[high] - times[low]) / count, at)
    means = (sums[high] - sums[low]) / count[:, None]
    after = np.clip(np.searchsorted(time, at), 1, len(time) - 1)
    span = time[after] - time[after - 1]
    slope = (values[after] - values[after - 1]) / span[:, None]
    straight = values[after - 1] + slope * (at - time[after - 1])[:, None]
    result = np.where((high - low >= 2)[:, None], means + slope * (at - centre)[:, None], straight)
    outside = (at < time[0] - 1e-9) | (at > time[-1] + 1e-9) | (span > bridge_s)
    result[outside] = np.nan
    return result


def _carried(at: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    known = np.isfinite(values)
    return np.interp(at, time[known], values[known]) if known.any() else np.full(len(at), np.nan)
