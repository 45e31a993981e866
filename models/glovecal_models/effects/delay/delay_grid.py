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
from enum import IntEnum

import numpy as np

from glovecal_models.effects.base.assessment import (
    BLOCK_ROWS,
    JointErrors,
    block_starts,
    squared_in_blocks,
)
from glovecal_models.effects.base.problem import Problem
from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.delay.row_filters import low_passed, window_means

STEP_S = 0.0025
SHORT_S = 0.03
"""Up to here, cells lie ``STEP_S`` apart: what a short filter leaves bends so much that a parabola through
cells of 10 ms makes a mere delay look like one."""
DELAY_STEP_S = 0.005
FILTER_STEP_S = 0.01
LARGEST_DELAY_S = 0.2
EVEN_S = 1e-6
FIRST_POLE_SHARE = 0.65
"""Of the delay of two poles."""
WINDOW_SHARE = 0.6
"""Length of a delayed window, of that of a moving average as late: a raised cosine has 0.63."""
BEND_S = 0.05
SHORT_ROWS = 25
FAST_SHARE = 1.0
"""Per second: a joint is moved fast when its speed reaches so many of its own standard deviations."""


class DelayForm(IntEnum):
    """What a cell does to the angle; its delay is the mean time it takes."""

    PURE = 0
    ONE_POLE = 1
    TWO_POLES = 2
    MOVING_AVERAGE = 3
    DELAYED_WINDOW = 4


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
    return None if fastest >= FAST_SHARE else "no fast motion was recorded"


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
    fine = [_Fine.of(take.time_s, take.own) for take in problem.signals]
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
    fine: Sequence[_Fine],
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
    moved = _moved([fine[take].track(joint, rows) for take, rows in used], form, delay)
    own = np.concatenate([problem.signals[take].own[rows, joint] for take, rows in used])
    slope = _slope(base, products.whole, own)
    left = target - orthogonal @ (orthogonal.T @ target)
    lengths = [len(rows) for _, rows in used]
    starts, ends = block_starts(lengths, block_rows), np.cumsum(lengths)
    bend = _bend(moved, form, delay, slope, own)
    blocks = squared_beside(left + slope * own, moved, slope, orthogonal, starts)
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


def squared_beside(
    target: np.ndarray, moved: np.ndarray, slope: np.ndarray, orthogonal: np.ndarray, starts: np.ndarray
) -> np.ndarray:
    """(B, K): squares, summed over the rows of each block, of what an ``orthogonal`` base (N, P) leaves of
    ``target`` (N,) less ``slope`` (N,) times each of ``moved`` (K, N).

    Each block is read once, while it lies in the processor's cache: what the base takes away is known from
    its products with the blocks.
    """
    ends = [*starts[1:].tolist(), len(target)]
    square = np.empty((len(starts), len(moved)))
    crossed = np.empty((len(starts), len(moved), orthogonal.shape[1]))
    for block, (start, end) in enumerate(zip(starts.tolist(), ends, strict=True)):
        left = moved[:, start:end] * slope[start:end]
        np.subtract(target[start:end], left, out=left)
        np.einsum("kn,kn->k", left, left, out=square[block])
        np.matmul(left, orthogonal[start:end], out=crossed[block])
    whole = crossed.sum(axis=0)
    for block, (start, end) in enumerate(zip(starts.tolist(), ends, strict=True)):
        rows = orthogonal[start:end]
        taken = whole @ (rows.T @ rows)
        taken -= 2.0 * crossed[block]
        square[block] += np.einsum("kp,kp->k", taken, whole)
    return np.maximum(square, 0.0)


def _bend(
    moved: np.ndarray, form: np.ndarray, delay: np.ndarray, slope: np.ndarray, own: np.ndarray
) -> np.ndarray:
    """(rows,): the angle ``BEND_S`` before and after, less twice itself."""
    either = (form == DelayForm.PURE) & (np.abs(np.abs(delay) - BEND_S) < 0.5 * STEP_S)
    return (moved[either] - own).sum(axis=0) * slope


def _slope(base: np.ndarray, coefficients: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Of the base along the own angle, (N,): by a smooth curve through its values."""
    x = (own - own.mean()) / max(float(own.std()), 1e-9)
    powers = np.polynomial.polynomial.polyvander(x, 3)
    curve = np.linalg.lstsq(powers, base @ coefficients, rcond=None)[0]
    slope = np.polynomial.polynomial.polyval(x, np.polynomial.polynomial.polyder(curve))
    return slope / max(float(own.std()), 1e-9)


@dataclass(frozen=True)
class _Fine:
    """The angles of one take on times ``STEP_S`` apart, cubic between its rows: straight lines would flatten
    fast motion as a filter does."""

    angles: np.ndarray
    """(R, F), degrees."""
    at: np.ndarray
    """(N,) places of the take's rows among the fine times."""

    @classmethod
    def of(cls, time: np.ndarray, own: np.ndarray) -> _Fine:
        """``own``: (N, R)."""
        if len(time) < 2:
            return cls(own.T.astype(float), np.arange(len(time)))
        from scipy.interpolate import CubicSpline  # slow to load, too

        factor = max(1, round(float(np.median(np.diff(time))) / STEP_S))
        fine_time = time[0] + STEP_S * np.arange((len(time) - 1) * factor + 1)
        fine = CubicSpline(time, own)(np.clip(fine_time, time[0], time[-1]))
        at = np.clip(np.searchsorted(fine_time, time - EVEN_S), 0, len(fine) - 1)
        return cls(np.ascontiguousarray(fine.T), at)

    def track(self, joint: int, rows: np.ndarray) -> _Track:
        return _Track(self.angles[joint], self.at[rows])


@dataclass(frozen=True)
class _Track:
    """The angle of one joint in one take."""

    fine: np.ndarray
    """(F,), degrees."""
    at: np.ndarray
    """(N,) places of the fitted rows among the fine times."""

    @property
    def backwards(self) -> _Track:
        return _Track(self.fine[::-1], len(self.fine) - 1 - self.at)


def _moved(tracks: Sequence[_Track], form: np.ndarray, delay: np.ndarray) -> np.ndarray:
    """(K, rows of all tracks): the angle after each form of delay."""
    own = np.concatenate([track.fine[track.at] for track in tracks])
    result = np.empty((len(form), len(own)))
    pure, late, early = form == DelayForm.PURE, delay > 0, delay < 0
    shifts = np.round(delay[pure] / STEP_S).astype(int)[:, None]
    ends = np.cumsum([len(track.at) for track in tracks]).tolist()
    for track, start, end in zip(tracks, [0, *ends], ends, strict=False):
        result[pure, start:end] = track.fine[np.clip(track.at - shifts, 0, len(track.fine) - 1)]
    _filter(result, tracks, form, np.where(late, delay, 0.0))
    _filter(result, [track.backwards for track in tracks], form, np.where(early, -delay, 0.0))
    result[~(pure | late | early)] = own
    return result


def _filter(result: np.ndarray, tracks: Sequence[_Track], form: np.ndarray, late_s: np.ndarray) -> None:
    """Fill the rows of ``result`` (K, rows of all tracks) whose filters are late, by ``late_s`` (K,) in the
    mean."""
    one = np.flatnonzero((form == DelayForm.ONE_POLE) & (late_s > 0))
    two = np.flatnonzero((form == DelayForm.TWO_POLES) & (late_s > 0))
    first, second = FIRST_POLE_SHARE * late_s[two], (1 - FIRST_POLE_SHARE) * late_s[two]
    passed = low_passed(
        [track.fine for track in tracks],
        [track.at for track in tracks],
        np.concatenate([late_s[one], first, second]) / STEP_S,
    )
    result[one] = passed[:, : len(one)].T
    # Two first-order filters in a row, in partial fractions.
    by_first, by_second = np.split(passed[:, len(one) :], 2, axis=1)
    by_first *= first / (first - second)
    by_second *= second / (first - second)
    by_first -= by_second
    result[two] = by_first.T
    is_window = np.isin(form, (DelayForm.MOVING_AVERAGE, DelayForm.DELAYED_WINDOW)) & (late_s > 0)
    length = 2 * late_s * np.where(form == DelayForm.DELAYED_WINDOW, WINDOW_SHARE, 1.0)
    from_s, to_s = (late_s - length / 2)[is_window], (late_s + length / 2)[is_window]
    ends = np.cumsum([len(track.at) for track in tracks]).tolist()
    for track, start, end in zip(tracks, [0, *ends], ends, strict=False):
        means = window_means(track.fine, track.at, from_s / STEP_S, to_s / STEP_S)
        result[is_window, start:end] = means
