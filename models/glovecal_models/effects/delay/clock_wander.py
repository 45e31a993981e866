"""Clock wander: within a take the reference clock's offset changes, as a servo pulls it in or a sync sets it.

In windows of a second each rotation says how much later the reference would have to be read to fit what is
predicted from the readings: the error over the speed. Rotations that disagree, and errors that last, make the
windows less sure. The offset is smoothed as a random walk, whose steps are as large as is likeliest (marginal
likelihood); it is followed only where that is far likelier than a constant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from glovecal_models.takes.take import Take

GRID_HZ = 50.0
SMOOTHED_ROWS = 9
WINDOW_S = 1.0
FEWEST_WINDOWS = 10
ROUNDS = 4
STEPS_S2 = np.geomspace(1e-7, 1e-2, 21)
"""Variance of the offset's change in a second, seconds squared."""
LIKELIER_NATS = 20.0
"""Of the log likelihood, over that of a constant offset. Of 72 healthy simulated takes 13 reach that."""
ANYWHERE_S2 = 1.0
"""Variance of the offset at the start: not known."""
RIDGE = 1e-3
"""Of a column's variance: keeps the map bounded when sensors say the same."""


@dataclass(frozen=True)
class ClockWander:
    """Reference time = frame time + offset, the offset in between by straight lines."""

    at_s: np.ndarray
    """(K,) frame times, seconds."""
    offset_s: np.ndarray
    """(K,) seconds."""

    def removed(self, take: Take) -> Take:
        """The take with its reference on the frames' clock."""
        fine = np.union1d(take.time_s, take.reference_time_s)
        seen = np.maximum.accumulate(fine + np.interp(fine, self.at_s, self.offset_s))
        moved = np.interp(take.reference_time_s, seen, fine)
        before, after = take.reference_time_s < seen[0], take.reference_time_s > seen[-1]
        moved = np.where(before, take.reference_time_s - (seen[0] - fine[0]), moved)
        moved = np.where(after, take.reference_time_s - (seen[-1] - fine[-1]), moved)
        later = np.diff(moved, prepend=-np.inf) > 0
        deviations = None if take.reference_sd is None else take.reference_sd[later]
        return replace(
            take, reference_time_s=moved[later], reference=take.reference[later], reference_sd=deviations
        )


def clock_wander(take: Take, rotations: Sequence[str], predicted: np.ndarray) -> ClockWander | None:
    """For angles (N, R) of ``rotations`` predicted at the frames, degrees; None where a constant will do."""
    columns = [(take.rotations.index(name), i) for i, name in enumerate(rotations) if name in take.rotations]
    if not columns or take.duration_s < FEWEST_WINDOWS * WINDOW_S or len(take.reference_time_s) < 10:
        return None
    time = np.arange(take.time_s[0], take.time_s[-1], 1 / GRID_HZ)
    window = np.floor((time - time[0]) / WINDOW_S).astype(int)
    centre = time[0] + WINDOW_S * (np.arange(window[-1] + 1) + 0.5)
    wanted = _smoothed(
        np.column_stack([np.interp(time, take.time_s, predicted[:, row]) for _, row in columns])
    )
    offset, walks = np.zeros(len(centre)), False
    for _ in range(ROUNDS):
        at = time + np.interp(time, centre, offset)
        angle = _smoothed(_reference(take, [column for column, _ in columns], at))
        speed = np.gradient(angle, 1 / GRID_HZ, axis=0)
        here, information = _by_window(wanted - angle, speed, window)
        if (information > 0).sum() < FEWEST_WINDOWS:
            return None
        offset, walks = _walked(centre, offset + here, information)
    return ClockWander(centre, offset) if walks else None


def without_wander(takes: Sequence[Take]) -> tuple[Take, ...]:
    """Takes whose offsets are constant otherwise, predicted by one map of readings and their squares.

    The map reads the sensors that all takes have; without any the takes stay as they are.
    """
    rotations = sorted({name for take in takes for name in take.rotations})
    sensors = (
        [name for name in takes[0].sensors if all(name in take.sensors for take in takes)] if takes else []
    )
    if not sensors:
        return tuple(takes)
    features = _features([take.readings[:, [take.sensors.index(name) for name in sensors]] for take in takes])
    predicted = [np.full((len(take.time_s), len(rotations)), np.nan) for take in takes]
    for place, name in enumerate(rotations):
        known = [_at_frames(take, name) for take in takes]
        x = np.concatenate([part[np.isfinite(y)] for part, y in zip(features, known, strict=True)])
        y = np.concatenate([part[np.isfinite(part)] for part in known])
        if len(y) < 2 * x.shape[1]:
            continue
        products = x.T @ x + RIDGE * len(x) * np.eye(x.shape[1])
        weights = np.linalg.solve(products, x.T @ (y - y.mean()))
        for part, angles in zip(features, predicted, strict=True):
            angles[:, place] = y.mean() + part @ weights
    told = np.asarray(np.isfinite(np.concatenate(predicted)).all(axis=0))
    names = [name for name, is_told in zip(rotations, told, strict=True) if is_told]
    found = []
    for take, angles in zip(takes, predicted, strict=True):
        wander = clock_wander(take, names, angles[:, told])
        found.append(take if wander is None else wander.removed(take))
    return tuple(found)


def _features(readings: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Readings and their squares, each with mean 0 and standard deviation 1."""
    return _standard([np.column_stack([part, part**2]) for part in _standard(readings)])


def _standard(parts: Sequence[np.ndarray]) -> list[np.ndarray]:
    every = np.concatenate(parts)
    centre, spread = every.mean(axis=0), np.maximum(every.std(axis=0), 1e-9)
    return [(part - centre) / spread for part in parts]


def _at_frames(take: Take, rotation: str) -> np.ndarray:
    if rotation not in take.rotations:
        return np.full(len(take.time_s), np.nan)
    return take.reference_at_frames([rotation])[:, 0]


def _reference(take: Take, columns: Sequence[int], at: np.ndarray) -> np.ndarray:
    """(M, R) at reference times, NaN outside of what was measured."""
    found = []
    for column in columns:
        known = np.isfinite(take.reference[:, column])
        if known.sum() < 2:
            found.append(np.full(len(at), np.nan))
            continue
        times = take.reference_time_s[known]
        found.append(np.interp(at, times, take.reference[known, column], np.nan, np.nan))
    return np.column_stack(found)


def _smoothed(values: np.ndarray) -> np.ndarray:
    weights = np.hanning(SMOOTHED_ROWS + 2)[1:-1]
    weights /= weights.sum()
    half = SMOOTHED_ROWS // 2
    padded = np.pad(values, ((half, half), (0, 0)), mode="edge")
    return np.column_stack([np.convolve(column, weights, "valid") for column in padded.T])


def _by_window(error: np.ndarray, speed: np.ndarray, window: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Offset (K,), seconds, and its information (K,), 1 / seconds squared, from errors and speeds (M, R)."""
    known = np.isfinite(error) & np.isfinite(speed)
    error, speed = np.where(known, error, 0.0), np.where(known, speed, 0.0)
    starts = np.flatnonzero(np.diff(window, prepend=-1))
    work, power = (np.add.reduceat(part, starts) for part in (error * speed, speed * speed))
    offset, variance = np.zeros(len(starts)), np.ones(error.shape[1])
    for _ in range(3):
        information = (power / variance).sum(axis=1)
        offset = np.divide(
            (work / variance).sum(axis=1), information, where=information > 0, out=np.zeros(len(starts))
        )
        # Of the work of a window, per unit of its power: errors that last, and rotations that disagree.
        left = work - offset[:, None] * power
        variance = np.maximum((left**2).sum(axis=0) / np.maximum(power.sum(axis=0), 1e-12), 1e-12)
    share = 1 - 1 / max(int((power.sum(axis=0) > 0).sum()), 1)
    return offset, (power / variance).sum(axis=1) * (share if share > 0 else 1.0)


def _walked(at: np.ndarray, offset: np.ndarray, information: np.ndarray) -> tuple[np.ndarray, bool]:
    """The likeliest random walk (K,) through the windows, or their mean; and whether it walks."""
    some = information > 1e-6 * information.max()
    noise = 1 / information[some]
    since = at[some] - at[0] + WINDOW_S
    shared = np.minimum(since[:, None], since[None, :])

    def fitted(step: float) -> tuple[float, np.ndarray]:
        prior = step * shared + ANYWHERE_S2
        factor = cho_factor(prior + np.diag(noise))
        solved = cho_solve(factor, offset[some])
        likelihood = -0.5 * offset[some] @ solved - np.log(np.diag(factor[0])).sum()
        between = step * np.minimum((at - at[0] + WINDOW_S)[:, None], since[None, :]) + ANYWHERE_S2
        return float(likelihood), between @ solved

    still, constant = fitted(0.0)
    likelihood, walk = max((fitted(step) for step in STEPS_S2), key=lambda item: item[0])
    return (walk, True) if likelihood - still > LIKELIER_NATS else (constant, False)
