"""Lag or clock offset? By the shape of the delay, its sign, and whether joints differ in it.

A common filter delays all joints alike, so equal delays are no mark of clocks; joints that differ are a mark
of lag. A reading that comes before the angle cannot be lag. Otherwise the shape decides: a lag smooths too.
That is judged on strongly smoothed signals, on which a low pass gains nothing by removing noise.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from glovecal_models.effects.base.assessment import over_joints
from glovecal_models.effects.base.limits import SIGNIFICANCE_LIMITS, SignificanceLimits
from glovecal_models.effects.base.problem import Problem
from glovecal_models.effects.delay.delay_grid import DelayErrors, delay_errors

SMOOTHING, SHAPE_SMOOTHING = 13, 25
"""Even times. With 13 a low pass still gains by taking noise from the reference: 4 standard errors."""

LAG, CLOCK = "lag", "clock_offset"
DelayKind = Literal["lag", "clock_offset", "either"]


@dataclass(frozen=True)
class ClockChoice:
    """The offset that explains most."""

    offset_s: np.ndarray
    """(1,) for all takes, or (takes,)."""
    cell: np.ndarray
    """(takes,) index among the cells of a mere delay, of each take."""

    @property
    def is_per_take(self) -> bool:
        return len(self.offset_s) > 1

    def errors(self, grids: Sequence[DelayErrors]) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """For each joint (B,): squared errors with the offset, and with the mirrored one."""
        size = len(grids[0].clock)
        true, mirrored = [], []
        for grid in grids:
            rows, cell = np.arange(len(grid.take)), self.cell[grid.take]
            true.append(grid.blocks[rows, grid.clock[cell]])
            mirrored.append(grid.blocks[rows, grid.clock[size - 1 - cell]])
        return true, mirrored


def clock_choice(
    grids: Sequence[DelayErrors], limits: SignificanceLimits = SIGNIFICANCE_LIMITS
) -> ClockChoice:
    """One offset for all takes, unless their own save clearly more (each judged on other blocks)."""
    clock, takes = grids[0].clock, int(max(grid.take.max() for grid in grids)) + 1
    share = [grid.blocks[:, clock] / grid.whole for grid in grids]
    each = np.array(
        [
            sum(part[grid.take == t].sum(axis=0) for part, grid in zip(share, grids, strict=True))
            for t in range(takes)
        ]
    )
    common = int(np.argmin(each.sum(axis=0)))
    own = np.array([int(np.argmin(row)) if row.any() else common for row in each])
    gain = each.sum(axis=0)[common] - _judged_on_other_blocks(share, grids, takes, common)
    delays = grids[0].cells[clock, 0]
    if takes > 1 and gain > limits.per_take_offset_share * len(grids):
        return ClockChoice(delays[own], own)
    return ClockChoice(delays[[common]], np.full(takes, common))


def _judged_on_other_blocks(
    share: Sequence[np.ndarray], grids: Sequence[DelayErrors], takes: int, common: int
) -> float:
    total = 0.0
    for take in range(takes):
        halves: list[np.ndarray] = []
        for parity in (0, 1):
            halves.append(
                np.sum([part[np.flatnonzero(grid.take == take)[parity::2]].sum(axis=0)
                        for part, grid in zip(share, grids, strict=True)], axis=0)
            )  # fmt: skip
        for chosen, judged in (halves, halves[::-1]):
            total += judged[int(np.argmin(chosen)) if chosen.any() else common]
    return float(total)


def first_delay(problem: Callable[[int], Problem]) -> tuple[str, tuple[str, ...]]:
    """The delay to be named first, and all that remain possible; ``problem`` by the rows smoothed over."""
    usual, strongly = problem(SMOOTHING), problem(SHAPE_SMOOTHING)
    limits = usual.limits
    kind, score = delay_kind(delay_errors(usual), delay_errors(strongly), limits)
    if kind != "either":
        return kind, (kind,)
    return (LAG, (LAG, CLOCK)) if score > limits.delay_middle_se else (CLOCK, (CLOCK, LAG))


def delay_kind(
    grids: Sequence[DelayErrors],
    strongly_smoothed: Sequence[DelayErrors],
    limits: SignificanceLimits = SIGNIFICANCE_LIMITS,
) -> tuple[DelayKind, float]:
    """The kind, and a score in standard errors: above ``delay_middle_se`` speaks for lag.

    ``grids`` are those of ``SMOOTHING``, the others of ``SHAPE_SMOOTHING``.
    """
    clear = limits.delay_clear_se
    clock = clock_choice(grids, limits)
    if np.median(clock.offset_s) <= 0:
        return "clock_offset", -np.inf
    if clock.is_per_take:
        return "clock_offset", -clear
    cells = grids[0].clock
    takes = [grid.take for grid in grids]
    own = [grid.blocks[:, cells[np.argmin(grid.blocks[:, cells].sum(axis=0))]] / grid.whole for grid in grids]
    shared = [grid.blocks[:, cells[clock.cell[0]]] / grid.whole for grid in grids]
    differ = _score(over_joints(shared, takes), over_joints(own, takes))
    shape = _shape_score(strongly_smoothed)
    if differ > 2 * clear and shape > -clear:
        return "lag", differ
    if shape > clear:
        return "lag", shape
    if shape < -clear + limits.delay_middle_se:
        return "clock_offset", shape
    return "either", shape


def _shape_score(grids: Sequence[DelayErrors]) -> float:
    """How much better one low pass for all joints does than one delay for all, in standard errors."""
    takes = [grid.take for grid in grids]
    clock = over_joints([grid.blocks[:, grid.clock] / grid.whole for grid in grids], takes)
    lag = over_joints([grid.blocks[:, grid.lag] / grid.whole for grid in grids], takes)
    return _score(clock[:, np.argmin(clock.sum(axis=0))], lag[:, np.argmin(lag.sum(axis=0))])


def _score(worse: np.ndarray, better: np.ndarray) -> float:
    gain = worse - better
    if len(gain) < 2:
        return 0.0
    return float(gain.mean() / max(gain.std(ddof=1) / np.sqrt(len(gain)), 1e-12))
