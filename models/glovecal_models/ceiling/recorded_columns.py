"""Everything recorded that an error may depend on, as columns; and the same columns with their tie cut.

Sensors and error are smoothed by one symmetric kernel: else every average over past readings gains, because
it removes noise. What smoothing leaves of that is told by a history that knows no direction: each column's
mean with its mirror image in time. It averages as much as the history does and knows nothing of what was
before. (The mirror image alone knows the direction of movement as well as the history does: of a lag it
gains all.)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.takes.take import Take

CEILING_HZ = 30.0
ROW_EVERY = 5
"""Grid points; the kernel makes those between say the same."""
MOST_ROWS = 6000
"""Of all takes; longer recordings have fewer rows a second."""
KERNEL_S = 0.1
"""Standard deviation."""
LAGS_S = (0.1, 0.2, 0.4, 0.8, 1.4, 2.0)
AVERAGES_S = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 60.0)
EXTREMES_S = (2.0, 10.0, 60.0)
OTHERS_LAGS_S = (0.2, 0.8)
OTHERS_AVERAGES_S = (5.0,)
GROUPS = ("readings", "history", "context", "wearing and time")


@dataclass(frozen=True)
class TakeColumns:
    """One take on an even grid of G times."""

    time_s: np.ndarray
    """(G,)"""
    groups: Mapping[str, np.ndarray]
    """(G, columns) by the names of ``GROUPS``."""
    symmetric_history: np.ndarray
    """The columns of the history, each averaged with its mirror image in time."""


def recorded_columns(
    takes: Sequence[Take], readings: Sequence[np.ndarray], own: Sequence[int], scale: np.ndarray
) -> list[TakeColumns]:
    """``readings``: for each take (N, S); ``own``: sensors with a long history; ``scale`` (S,)."""
    context = sorted({name for take in takes for name in take.context})
    wearings = list(dict.fromkeys(take.wearing for take in takes))
    shares_clock = _shares_clock(takes)
    seen: dict[str, list[float]] = {}
    found = []
    for take, values in zip(takes, readings, strict=True):
        time = _grid(take)
        smooth = _smoothed(_at(time, take.time_s, values / scale))
        past = _history(smooth, own)
        mirrored = _history(smooth[::-1], own)[::-1]
        before = seen.setdefault(take.wearing, [])
        first = before[0] if before and shares_clock else take.start_s
        session = [
            *(np.full(len(time), float(take.wearing == name)) for name in wearings),
            np.full(len(time), float(len(before))),
            time - first,
        ]
        before.append(take.start_s)
        groups = {
            "readings": smooth,
            "history": past,
            "context": _context(take, time, context),
            "wearing and time": np.column_stack(session),
        }
        found.append(TakeColumns(time, groups, (past + mirrored) / 2))
    return found


def own_averages(own: Sequence[int], sensors: int) -> dict[int, list[int]]:
    """For each own sensor the places of its running averages in the history."""
    found, at = {}, 0
    for sensor in range(sensors):
        if sensor in own:
            found[sensor] = list(range(at + len(LAGS_S), at + len(LAGS_S) + len(AVERAGES_S)))
            at += len(LAGS_S) + len(AVERAGES_S) + 2 * len(EXTREMES_S)
        else:
            at += len(OTHERS_LAGS_S) + len(OTHERS_AVERAGES_S)
    return found


def smoothed_error(time_s: np.ndarray, take: Take, error: np.ndarray) -> np.ndarray:
    """``error`` (N,) at the grid ``time_s`` (G,), smoothed as readings are; NaN where none was measured."""
    known = np.isfinite(error)
    if known.sum() < 2:
        return np.full(len(time_s), np.nan)
    near = np.interp(time_s, take.time_s, known.astype(float)) > 0.99
    values = np.where(near, np.interp(time_s, take.time_s[known], error[known]), 0.0)
    weight, total = (_smoothed(part, "constant") for part in (near.astype(float), values))
    return np.where(near, total / np.maximum(weight, 1e-9), np.nan)


def exchanged(parts: Sequence[np.ndarray], order: Sequence[int]) -> list[np.ndarray]:
    """For each take the rows of another one, ``order`` says which, shifted by half its length."""
    found = []
    for part, other in zip(parts, order, strict=True):
        source = parts[other]
        at = (np.arange(len(part)) + len(source) // 2) % max(len(source), 1)
        found.append(source[at])
    return found


def exchange_order(wearings: Sequence[str], generator: np.random.Generator) -> list[int]:
    """No take keeps its own, and few get those of their own wearing."""
    count = len(wearings)
    best, fewest = list(range(count)), count + 1
    for _ in range(50):
        order = generator.permutation(count).tolist()
        same = sum(wearings[at] == wearings[other] for at, other in enumerate(order))
        kept = sum(at == other for at, other in enumerate(order))
        if not kept and same < fewest:
            best, fewest = order, same
    return best


def _shares_clock(takes: Sequence[Take]) -> bool:
    """Whether the takes of a wearing follow one another on one clock."""
    last: dict[str, float] = {}
    for take in takes:
        if take.start_s < last.get(take.wearing, -np.inf):
            return False
        last[take.wearing] = float(take.time_s[-1])
    return True


def _grid(take: Take) -> np.ndarray:
    return take.time_s[0] + np.arange(int(take.duration_s * CEILING_HZ) + 1) / CEILING_HZ


def _at(time: np.ndarray, frames: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.column_stack([np.interp(time, frames, column) for column in values.T])


def _smoothed(values: np.ndarray, beyond: str = "nearest") -> np.ndarray:
    """``beyond``: what stands beyond the ends, a ``mode`` of SciPy's filters."""
    from scipy.ndimage import gaussian_filter1d  # slow to load, and every service loads this file

    return gaussian_filter1d(values, KERNEL_S * CEILING_HZ, axis=0, mode=beyond)


def _context(take: Take, time: np.ndarray, names: Sequence[str]) -> np.ndarray:
    columns = []
    for name in names:
        values = take.context.get(name)
        known = np.zeros(0, bool) if values is None else np.isfinite(values)
        if values is None or not known.any():
            columns.append(np.full(len(time), np.nan))
        else:
            columns.append(np.interp(time, take.time_s[known], values[known]))
    return np.column_stack(columns) if columns else np.empty((len(time), 0))


def _history(smooth: np.ndarray, own: Sequence[int]) -> np.ndarray:
    """All as differences from the reading now."""
    columns = []
    for sensor, x in enumerate(smooth.T):
        lags, averages, extremes = OTHERS_LAGS_S, OTHERS_AVERAGES_S, ()
        if sensor in own:
            lags, averages, extremes = LAGS_S, AVERAGES_S, EXTREMES_S
        columns += [_before(x, lag) - x for lag in lags]
        columns += [_average(x, tau) - x for tau in averages]
        columns += [_largest(sign * x, window) - sign * x for window in extremes for sign in (1.0, -1.0)]
    return np.column_stack(columns)


def _before(x: np.ndarray, lag_s: float) -> np.ndarray:
    steps = round(lag_s * CEILING_HZ)
    return np.concatenate([np.full(min(steps, len(x)), np.nan), x[: max(len(x) - steps, 0)]])


def _average(x: np.ndarray, tau_s: float) -> np.ndarray:
    """Exponential, of what was seen so far."""
    from scipy.signal import lfilter  # takes a second to load, which most commands need not wait for

    keep = np.exp(-1.0 / (tau_s * CEILING_HZ))
    total, weight = (lfilter([1.0], [1.0, -keep], values) for values in (x, np.ones(len(x))))
    return np.asarray(total) / np.asarray(weight)


def _largest(x: np.ndarray, window_s: float) -> np.ndarray:
    """Of the last ``window_s``; by doubling, so that long windows cost little."""
    width, result = round(window_s * CEILING_HZ), x.copy()
    done = 1
    while done < width:
        step = min(done, width - done)
        result[step:] = np.maximum(result[step:], result[:-step].copy())
        done += step
    return result
