"""How long a sensor's answer comes after the angle, and how much it is spread out.

Clocks that disagree only delay, or advance, and so does a transport; filters smooth too. In the direction
sensor-from-angle several forms of delay are tried on all joints: a pure delay, one and two poles, a moving
average, and a delayed symmetric window, shorter than a moving average as late. Filters run backwards in time,
which no sensor can do, are the control. The base bends with the angle: a delayed angle enters by the base's
slope. All cells are compared at once by projecting them off the base.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.effects.base.assessment import (
    BLOCK_ROWS,
    JointErrors,
    block_starts,
    squared_in_blocks,
)
from glovecal_models.effects.base.comparison import Problem
from glovecal_models.effects.base.relations import FAST, LackOfMotion
from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.delay.moved_angles import STEP_S, DelayForm, FineAngles, MovedCells

SHORT_S = 0.03
"""Up to here, cells lie ``STEP_S`` apart: what a short filter leaves bends so much that a parabola through
cells of 10 ms makes a mere delay look like one."""
DELAY_STEP_S = 0.005
FILTER_STEP_S = 0.01
LARGEST_DELAY_S = 0.2
BEND_S = 0.05
SHORT_ROWS = 25
FAST_SHARE = 1.0
"""Per second: a joint is moved fast when its speed reaches so many of its own standard deviations."""
FILTERS = (DelayForm.ONE_POLE, DelayForm.TWO_POLES, DelayForm.MOVING_AVERAGE)
"""Those that a lag may have."""
RUN_BACKWARDS = (DelayForm.PURE, DelayForm.ONE_POLE, DelayForm.MOVING_AVERAGE)


@dataclass(frozen=True)
class DelayErrors:
    """Squared errors of one joint for each form and delay."""

    form: np.ndarray
    """(K,) ``DelayForm``."""
    delay_s: np.ndarray
    """(K,), rising within each form; of a filter below zero: run backwards in time."""
    blocks: np.ndarray
    """(B, K), degrees squared, summed over the rows of each block."""
    unmoved: np.ndarray
    """(B,), without any delay."""
    take: np.ndarray
    """(B,), the take each block lies in."""
    fast: np.ndarray
    """(B,), degrees squared: how much the angle bends within ``BEND_S``, where filters show."""
    rows: int
    """Of all blocks."""

    @property
    def whole(self) -> float:
        """The sum without any delay, to tell shares of it; 1 where there is no error at all."""
        return float(self.unmoved.sum()) or 1.0

    @property
    def clock(self) -> np.ndarray:
        """Cells of a mere delay."""
        return self.cells(DelayForm.PURE)

    @property
    def lag(self) -> np.ndarray:
        return np.flatnonzero(np.isin(self.form, FILTERS) & (self.delay_s >= 0))

    @property
    def reversed_lag(self) -> np.ndarray:
        return np.flatnonzero(np.isin(self.form, FILTERS) & (self.delay_s <= 0))

    def cells(self, form: DelayForm) -> np.ndarray:
        """Those of one form, by rising delay."""
        return np.flatnonzero(self.form == form)


def why_no_delay_shows(takes: Sequence[Signals]) -> str | None:
    """None where some joint moved fast enough."""
    fastest = max((_speed(take) for take in takes), default=0.0)
    return None if fastest >= FAST_SHARE else LackOfMotion("no fast motion was recorded", FAST)


def _speed(take: Signals) -> float:
    """95th percentile of the speed of the liveliest joint, in its standard deviations per second."""
    if len(take) < 10:
        return 0.0
    speed = np.abs(np.diff(take.own, axis=0)) / np.diff(take.time_s)[:, None]
    return float(np.max(np.percentile(speed, 95, axis=0) / np.maximum(take.own.std(axis=0), 1e-9)))


def delay_errors(problem: Problem) -> tuple[DelayErrors, ...]:
    """One for each joint; worked out once for all delays that are judged."""
    return problem.once("delays", lambda: _delay_errors(problem))


def short_delay_errors(problem: Problem) -> tuple[DelayErrors, ...]:
    """The same in blocks of a second: fast motion seldom lasts for more."""
    return problem.once("delays in short blocks", lambda: _delay_errors(problem, SHORT_ROWS))


def _delay_errors(problem: Problem, block_rows: int = BLOCK_ROWS) -> tuple[DelayErrors, ...]:
    form, delay = _cells()
    fine = [FineAngles.of(take.time_s, take.own) for take in problem.signals]
    joints = range(len(problem.rotations))
    return tuple(_joint(problem, fine, joint, form, delay, block_rows) for joint in joints)


def held_out_beside(
    problem: Problem, true: Sequence[np.ndarray], control: Sequence[np.ndarray]
) -> tuple[JointErrors, ...]:
    """What cells of the grid save: for each joint (B,) errors of the right cells and of the control's.

    The grid is fitted to all units; what it saves is taken from the error on units left out.
    """
    found = []
    for joint, grid in enumerate(delay_errors(problem)):
        products = problem.products[joint]
        starts = block_starts([len(part) for part in products.residual])
        base = squared_in_blocks(products.residual, starts)
        added, mirrored = (base - grid.unmoved + part[joint] for part in (true, control))
        found.append(JointErrors(base, added, mirrored, int(products.count.sum()), grid.take))
    return tuple(found)


def _cells() -> tuple[np.ndarray, np.ndarray]:
    """Form and delay (K,) of each."""
    form, delay = [], []
    for item in DelayForm:
        step = DELAY_STEP_S if item == DelayForm.PURE else FILTER_STEP_S
        long = np.arange(SHORT_S + step, LARGEST_DELAY_S + step / 2, step)
        late = np.concatenate([np.arange(STEP_S, SHORT_S + STEP_S / 2, STEP_S), long])
        delays = np.concatenate([-late[::-1] if item in RUN_BACKWARDS else [], [0.0], late])
        form.append(np.full(len(delays), item))
        delay.append(delays)
    return np.concatenate(form), np.concatenate(delay)


def _joint(
    problem: Problem,
    fine: Sequence[FineAngles],
    joint: int,
    form: np.ndarray,
    delay: np.ndarray,
    block_rows: int,
) -> DelayErrors:
    products = problem.products[joint]
    base = np.concatenate([unit.base for unit in products.units])
    orthogonal, _ = np.linalg.qr(base)
    target = np.concatenate([unit.target for unit in products.units])
    used = list(problem.units(joint))
    tracks = [fine[take].track(joint, rows) for take, rows in used]
    own = np.concatenate([problem.signals[take].own[rows, joint] for take, rows in used])
    slope = base_slope(base, products.whole, own)
    left = target - orthogonal @ (orthogonal.T @ target)
    lengths = [len(rows) for _, rows in used]
    starts, ends = block_starts(lengths, block_rows), np.cumsum(lengths)
    cells = MovedCells.of(form, delay)
    bend, found = np.empty(len(target)), []
    either = np.flatnonzero(np.abs(np.abs(cells.pure_s) - BEND_S) < 0.5 * STEP_S)
    for moved, first, stop in zip(cells.of_tracks(tracks), [0, *ends.tolist()], ends.tolist(), strict=False):
        rows = slice(first, stop)
        bend[rows] = (moved.read[either] - own[rows]).sum(axis=0) * slope[rows]
        inner = starts[(starts >= first) & (starts < stop)].tolist()
        for start, end in zip(inner, [*inner[1:], stop], strict=False):
            block, here = slice(start, end), slice(start - first, end - first)
            beside = moved.differences(here, left[block] + slope[block] * own[block], slope[block])
            found.append(crossed_with(*beside, orthogonal[block]))
    blocks = np.empty((len(starts), len(form)))
    blocks[:, cells.order] = squared_beside(found, orthogonal, starts)
    unmoved = np.add.reduceat(left * left, starts)
    blocks[:, delay == 0.0] = unmoved[:, None]  # to the last bit: no delay saves nothing
    return DelayErrors(
        form,
        delay,
        blocks,
        unmoved,
        np.array(problem.unit_take)[np.searchsorted(ends, starts, side="right")],
        np.add.reduceat(bend * bend, starts),
        len(target),
    )


def crossed_with(
    by_cell: np.ndarray, by_row: np.ndarray, orthogonal: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Of one block, while it lies in the processor's cache: squares (K,) of what is left in each cell,
    (K1, N) and (N, K2), and their products (K, P) with an ``orthogonal`` base (N, P)."""
    square = [np.einsum("kn,kn->k", by_cell, by_cell), np.einsum("nk,nk->k", by_row, by_row)]
    return np.concatenate(square), np.concatenate([by_cell @ orthogonal, by_row.T @ orthogonal])


def squared_beside(
    blocks: Sequence[tuple[np.ndarray, np.ndarray]], orthogonal: np.ndarray, starts: np.ndarray
) -> np.ndarray:
    """(B, K): squares of each block without what an ``orthogonal`` base (N, P) of all rows takes away, which
    is known from its products with the blocks."""
    whole = np.sum([crossed for _, crossed in blocks], axis=0)
    ends = [*starts[1:].tolist(), len(orthogonal)]
    result = np.empty((len(blocks), len(whole)))
    for number, (start, end) in enumerate(zip(starts.tolist(), ends, strict=True)):
        square, crossed = blocks[number]
        rows = orthogonal[start:end]
        taken = whole @ (rows.T @ rows)
        taken -= 2.0 * crossed
        np.add(square, np.einsum("kp,kp->k", taken, whole), out=result[number])
    return np.maximum(result, 0.0)


def base_slope(base: np.ndarray, coefficients: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Of the base along the own angle, (N,): by a smooth curve through its values."""
    x = (own - own.mean()) / max(float(own.std()), 1e-9)
    powers = np.polynomial.polynomial.polyvander(x, 3)
    curve = np.linalg.lstsq(powers, base @ coefficients, rcond=None)[0]
    slope = np.polynomial.polynomial.polyval(x, np.polynomial.polynomial.polyder(curve))
    return slope / max(float(own.std()), 1e-9)
