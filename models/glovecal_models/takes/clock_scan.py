"""Where the reference clock lies against the glove's, by scanning offsets take by take.

The estimator of the effect ``clock_offset``. Each take may have an offset of its
own (recorders are often started by hand). For each take the reference is read at shifted times, and the shift
is wanted at which the sensors explain it best, by a linear map; then the takes of a wearing share one map and
each offset is polished against it. Sensors played backwards get the same freedom: they show how small the
unexplained part becomes by chance, and an offset counts only if it does much better.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from glovecal_models.takes.answer import ClockVerdict
from glovecal_models.takes.take import Take

RANGE_S = 3.0
COARSE_S, FINE_S = 0.02, 0.005
GRID_HZ = 50.0
LEAST_OVERLAP = 0.6
"""Of the frames that the reference can cover."""
RIDGE = 1e-3
"""Of a sensor's variance: keeps the map bounded when sensors say the same."""
POLISHING_ROUNDS = 3
POLISHED_WITHIN_S = 0.12
BETTER_THAN_REVERSED = 0.5
WORTHWHILE = 0.9
"""The unexplained variance must fall to this share (5 % of the error) for an offset to be named."""
LOOKS_LIKE_LAG_S = -0.15
"""Readings this much late may as well come from a lag in the sensors."""
SHORTEST_SCANNED_S = 2.0


@dataclass(frozen=True)
class ClockOffset:
    """The clocks of one take."""

    take: str
    verdict: ClockVerdict
    offset_s: float
    """Reference time = frame time + offset, seconds; 0 unless the verdict is "offset"."""
    low_s: float
    high_s: float
    """Offsets with an unexplained variance of up to twice the least."""
    unexplained_before: float
    """Share of the reference's variance that a linear map of the sensors leaves, without offset."""
    unexplained_after: float
    unexplained_reversed: float
    """The least share with the sensors played backwards: what chance gives."""
    sentence: str

    @property
    def is_unknown(self) -> bool:
        """Whether the reference moves and yet its clock was not found."""
        moves = self.unexplained_reversed < 1.0
        return self.verdict == "range too small" or (self.verdict == "not identifiable" and moves)


@dataclass(frozen=True)
class Grid:
    """One take on even times: readings there, and the reference as a function of the offset."""

    take: Take
    time_s: np.ndarray
    readings: np.ndarray
    columns: tuple[int, ...]
    """Reference columns that move."""
    most_overlap: float
    """Share of the times that the reference can cover: it may be shorter than the frames."""

    def reference(self, at: np.ndarray) -> np.ndarray:
        """(N, R) at reference times (N,), NaN outside the recording."""
        known = [
            np.interp(at, self.take.reference_time_s, self.take.reference[:, column], np.nan, np.nan)
            for column in self.columns
        ]
        return np.column_stack(known)


def clock_offsets(takes: Sequence[Take]) -> tuple[ClockOffset, ...]:
    """One answer per take, in their order; takes of one wearing are judged together."""
    grids = [on_grid(take) for take in takes]
    scans = [None if grid is None else _scan(grid, grid.readings) for grid in grids]
    polished = _polished(takes, grids, [None if scan is None else _least(scan) for scan in scans])
    return tuple(
        _judged(take, grid, scan, offset)
        for take, grid, scan, offset in zip(takes, grids, scans, polished, strict=True)
    )


def aligned(take: Take, offset_s: float) -> Take:
    """The take with its reference on the frames' clock."""
    return replace(take, reference_time_s=take.reference_time_s - offset_s)


def without_reference(take: Take) -> Take:
    """The take as if nothing had been measured."""
    return replace(take, reference=np.full_like(take.reference, np.nan))


def on_grid(take: Take) -> Grid | None:
    """None when the take is too short, nothing was measured, or nothing moves."""
    if take.duration_s < SHORTEST_SCANNED_S or len(take.reference_time_s) < 10:
        return None
    complete = np.isfinite(take.reference).all(axis=0)
    moves = complete & (np.ptp(np.where(complete, take.reference, 0.0), axis=0) > 5.0)
    if not moves.any():
        return None
    count = int(take.duration_s * GRID_HZ) + 1
    time = take.time_s[0] + np.arange(count) / GRID_HZ
    readings = np.column_stack([np.interp(time, take.time_s, column) for column in take.readings.T])
    measured_s = float(take.reference_time_s[-1] - take.reference_time_s[0])
    return Grid(
        take, time, readings, tuple(np.flatnonzero(moves).tolist()), min(1.0, measured_s / take.duration_s)
    )


def _offsets(width_s: float, step_s: float, centre_s: float = 0.0) -> np.ndarray:
    steps = round(width_s / step_s)
    return centre_s + step_s * np.arange(-steps, steps + 1)


_COARSE = _offsets(RANGE_S, COARSE_S)


def unexplained(grid: Grid, readings: np.ndarray, at: np.ndarray) -> float:
    """Share of the variance of the reference at times ``at`` (N,) that a ridge-linear map of ``readings``
    leaves; NaN: no overlap."""
    reference = grid.reference(at)
    known = np.isfinite(reference[:, 0])
    if known.mean() < LEAST_OVERLAP * grid.most_overlap:
        return np.nan
    x, y = readings[known], reference[known]
    x, y = x - x.mean(axis=0), y - y.mean(axis=0)
    x = x / np.maximum(x.std(axis=0), 1e-9)
    gram = x.T @ x + RIDGE * len(x) * np.eye(x.shape[1])
    projection = x.T @ y
    left = np.sum(y * y) - np.sum(projection * np.linalg.solve(gram, projection))
    return float(left / max(np.sum(y * y), 1e-12))


def _scan(grid: Grid, readings: np.ndarray) -> np.ndarray:
    """The unexplained share at each of ``_COARSE``, as ``unexplained`` has it: those are whole steps of the
    grid, so that the reference is read once and sums over windows of it are compared."""
    rows, furthest = len(grid.time_s), len(_COARSE) // 2
    every = grid.time_s[0] + np.arange(-furthest, rows + furthest) / GRID_HZ
    reference = grid.reference(every)
    is_known = np.isfinite(reference[:, 0])
    y = (
        np.where(is_known[:, None], reference - np.nanmean(reference, axis=0), 0.0)
        if is_known.any()
        else reference
    )
    x = readings - readings.mean(axis=0)
    x = x / np.maximum(x.std(axis=0), 1e-9)
    count = _window_sums(is_known[:, None].astype(float), rows)[:, 0]
    enough = np.flatnonzero(count / rows >= LEAST_OVERLAP * grid.most_overlap)
    found = np.full(len(_COARSE), np.nan)
    if not len(enough):
        return found
    enough = slice(int(enough[0]), int(enough[-1]) + 1)
    # What is known of the reference has no gaps, so the rows that see it are a range of them.
    seen = sliding_window_view(is_known, rows)[enough]
    first, count = seen.argmax(axis=1), count[enough, None]
    last, sensors = first + count[:, 0].astype(int), x.shape[1]
    products = (x[:, :, None] * x[:, None, :]).reshape(rows, sensors**2)
    sums, of_products = _running(x), _running(products)
    of_x, of_y = (sums[last] - sums[first]) / count, _window_sums(y, rows)[enough] / count
    gram = (of_products[last] - of_products[first]).reshape(-1, sensors, sensors)
    gram -= count[:, :, None] * of_x[:, :, None] * of_x[:, None, :]
    crossed = sliding_window_view(y, rows, axis=0)[enough] @ x
    crossed -= count[:, :, None] * of_y[:, :, None] * of_x[:, None, :]
    whole = (_window_sums(y**2, rows)[enough] - count * of_y**2).sum(axis=1)
    size = np.maximum(np.sqrt(np.maximum(np.einsum("kss->ks", gram), 0.0) / count), 1e-9)
    gram /= size[:, :, None] * size[:, None, :]
    crossed = (crossed / size[:, None, :]).swapaxes(1, 2)
    gram += RIDGE * count[:, :, None] * np.eye(sensors)
    explained = (crossed * np.linalg.solve(gram, crossed)).sum(axis=(1, 2))
    found[enough] = (whole - explained) / np.maximum(whole, 1e-12)
    return found


def _running(values: np.ndarray) -> np.ndarray:
    """Sums of the first 0 to N rows (N, C)."""
    return np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])


def _window_sums(values: np.ndarray, rows: int) -> np.ndarray:
    """Sums over each run of ``rows`` rows of (N, C)."""
    sums = _running(values)
    return sums[rows:] - sums[:-rows]


def _least(scan: np.ndarray) -> float:
    return float(_COARSE[np.nanargmin(scan)]) if np.isfinite(scan).any() else 0.0


def _polished(
    takes: Sequence[Take], grids: Sequence[Grid | None], coarse: Sequence[float | None]
) -> list[float | None]:
    """Each offset against a map that the takes of a wearing share, in turns."""
    offsets = list(coarse)
    for wearing in dict.fromkeys(take.wearing for take in takes):
        members = [i for i, take in enumerate(takes) if take.wearing == wearing and grids[i] is not None]
        for _ in range(POLISHING_ROUNDS if len(members) > 1 else 0):
            rows = {i: _rows(grids[i], offsets[i]) for i in members}
            for i in members:
                slope, centre = _map(list(rows.values()))
                offsets[i] = _best_for_map(grids[i], offsets[i], slope, centre)
                rows[i] = _rows(grids[i], offsets[i])
    return offsets


def _rows(grid: Grid | None, offset_s: float | None) -> tuple[np.ndarray, np.ndarray]:
    """Readings with a one beside them, and every rotation's reference, where both are known."""
    assert grid is not None
    reference = _all_rotations(grid, offset_s or 0.0)
    known = np.isfinite(reference).all(axis=1)
    return np.column_stack([np.ones(known.sum()), grid.readings[known]]), reference[known]


def _all_rotations(grid: Grid, offset_s: float) -> np.ndarray:
    at, take = grid.time_s + offset_s, grid.take
    columns = [np.interp(at, take.reference_time_s, values, np.nan, np.nan) for values in take.reference.T]
    return np.column_stack(columns)


def _map(rows: list[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """Ridge-linear map of the wearing's sensors: coefficients (1 + S, R) for standardised readings, scale."""
    x, y = (np.concatenate(parts) for parts in zip(*rows, strict=True))
    scale = x.std(axis=0)
    scale[scale < 1e-9] = 1.0  # the one, and what never moves
    x = x / scale
    return np.linalg.solve(x.T @ x + RIDGE * len(x) * np.eye(x.shape[1]), x.T @ y), scale


def _best_for_map(
    grid: Grid | None, centre_s: float | None, slope: np.ndarray, scale: np.ndarray
) -> float | None:
    assert grid is not None
    predicted = np.column_stack([np.ones(len(grid.readings)), grid.readings]) / scale @ slope
    offsets = _offsets(POLISHED_WITHIN_S, FINE_S, centre_s or 0.0)
    left = [_mean_square(predicted - _all_rotations(grid, offset)) for offset in offsets]
    return float(offsets[int(np.argmin(left))])


def _mean_square(values: np.ndarray) -> float:
    """Mean of the finite values; faster than ``np.nanmean`` on short arrays."""
    if np.isfinite(values).all():
        return float(np.mean(values**2))
    return float(np.nanmean(values**2))


def _judged(take: Take, grid: Grid | None, scan: np.ndarray | None, offset_s: float | None) -> ClockOffset:
    if grid is None or scan is None or offset_s is None or not np.isfinite(scan).any():
        sentence = (
            f"Take {take.name}: the clocks cannot be judged; too short, or the reference never moves, or "
            "hardly overlaps it."
        )
        return ClockOffset(take.name, "not identifiable", 0.0, -RANGE_S, RANGE_S, 1.0, 1.0, 1.0, sentence)
    before = unexplained(grid, grid.readings, grid.time_s)
    after = unexplained(grid, grid.readings, grid.time_s + offset_s)
    least = float(np.nanmin(_scan(grid, grid.readings[::-1])))
    near = _COARSE[scan <= 2.0 * after]
    low, high = (float(near.min()), float(near.max())) if len(near) else (offset_s, offset_s)
    verdict: ClockVerdict = "offset"
    if after > BETTER_THAN_REVERSED * least:
        verdict = "not identifiable"
    elif abs(offset_s) >= RANGE_S - COARSE_S:
        verdict = "range too small"
    elif not after <= WORTHWHILE * before:
        verdict = "agrees"
    return ClockOffset(
        take.name, verdict, offset_s if verdict == "offset" else 0.0, low, high, before, after, least,
        _sentence(take.name, verdict, offset_s, before, after),
    )  # fmt: skip


def _sentence(take: str, verdict: ClockVerdict, offset_s: float, before: float, after: float) -> str:
    if verdict == "not identifiable":
        return f"Take {take}: the clocks cannot be judged; sensors played backwards fit nearly as well."
    if verdict == "range too small":
        return f"Take {take}: the best offset is at the end of ±{RANGE_S:g} s; the clocks differ by more."
    if verdict == "agrees":
        return f"Take {take}: the clocks agree."
    side = "behind" if offset_s < 0 else "ahead of"
    slow = " Slow sensors look the same." if LOOKS_LIKE_LAG_S <= offset_s < 0 else ""
    return (
        f"Take {take}: the reference clock is {abs(offset_s):.2f} s {side} the glove's; with that the part "
        f"no linear map explains falls from {100 * before:.1f} to {100 * after:.1f} % of the variance.{slow}"
    )
