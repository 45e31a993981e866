"""Lag or clock offset: how long a sensor's answer comes after the angle, and how much it is spread out.

A lag delays and smooths; clocks that disagree only delay, or advance. In the direction sensor-from-angle a
grid of (pure delay d) x (low pass tau) is tried on all joints; negative tau is the low pass run backwards in
time, which no sensor can do: the control. The base bends with the angle: a delayed angle enters by the base's
slope. All cells are compared at once by projecting them off the base.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from glovecal_models.effects.base.assessment import JointErrors, block_starts, squared_in_blocks
from glovecal_models.effects.base.problem import Problem
from glovecal_models.effects.base.signals import Signals

STEP_S = 0.005
LARGEST_DELAY_S = 0.2
TAU_S = (0.005, 0.01, 0.015, 0.02, 0.025, 0.03, 0.035, 0.04, 0.05, 0.06, 0.07, 0.08, 0.1, 0.12, 0.15, 0.2)
BOTH_TAU_S = (0.02, 0.04, 0.07, 0.12)
BOTH_STEP_S = 0.02
FAST_SHARE = 1.0
"""Per second: a joint is moved fast when its speed reaches so many of its own standard deviations."""


@dataclass(frozen=True)
class DelayErrors:
    """Squared errors of one joint for each pair of delay and low pass."""

    cells: np.ndarray
    """(K, 2): delay (s), tau (s); a negative tau runs backwards in time."""
    blocks: np.ndarray
    """(B, K), degrees squared, summed over the rows of each block."""
    unmoved: np.ndarray
    """(B,), without delay and low pass."""
    take: np.ndarray
    """(B,), the take each block lies in."""

    @property
    def whole(self) -> float:
        """The sum without delay and low pass, to tell shares of it; 1 where there is no error at all."""
        return float(self.unmoved.sum()) or 1.0

    @property
    def clock(self) -> np.ndarray:
        """Cells of a mere delay."""
        return np.flatnonzero(self.cells[:, 1] == 0)

    @property
    def lag(self) -> np.ndarray:
        return np.flatnonzero((self.cells[:, 0] == 0) & (self.cells[:, 1] >= 0))

    @property
    def reversed_lag(self) -> np.ndarray:
        return np.flatnonzero((self.cells[:, 0] == 0) & (self.cells[:, 1] <= 0))


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


def _delay_errors(problem: Problem) -> tuple[DelayErrors, ...]:
    cells = _cells()
    return tuple(_joint(problem, joint, cells) for joint in range(len(problem.rotations)))


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


def _cells() -> np.ndarray:
    steps = round(LARGEST_DELAY_S / STEP_S)
    cells = [(STEP_S * k, 0.0) for k in range(-steps, steps + 1)]
    cells += [(0.0, sign * tau) for tau in TAU_S for sign in (1, -1)]
    coarse = round(0.1 / BOTH_STEP_S)
    cells += [(BOTH_STEP_S * k, tau) for k in range(-coarse, coarse + 1) if k for tau in BOTH_TAU_S]
    return np.array(cells)


def _joint(problem: Problem, joint: int, cells: np.ndarray) -> DelayErrors:
    products = problem.products[joint]
    base = np.concatenate([unit.base for unit in products.units])
    orthogonal, _ = np.linalg.qr(base)
    target = np.concatenate([unit.target for unit in products.units])
    used = [(problem.signals[take], rows) for take, rows in problem.units(joint)]
    moved = np.concatenate([_moved(take.time_s, take.own[:, joint], rows, cells) for take, rows in used])
    own = np.concatenate([take.own[rows, joint] for take, rows in used])
    moved *= _slope(base, products.whole, own)[:, None]
    left = target - orthogonal @ (orthogonal.T @ target)
    moved -= orthogonal @ (orthogonal.T @ moved)
    np.subtract(left[:, None], moved, out=moved)
    lengths = [len(rows) for _, rows in used]
    starts = block_starts(lengths)
    ends = np.cumsum(lengths)
    return DelayErrors(
        cells,
        np.add.reduceat(moved * moved, starts, axis=0),
        np.add.reduceat(left * left, starts),
        np.array(problem.unit_take)[np.searchsorted(ends, starts, side="right")],
    )


def _slope(base: np.ndarray, coefficients: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Of the base along the own angle, (N,): by a smooth curve through its values."""
    x = (own - own.mean()) / max(float(own.std()), 1e-9)
    powers = np.polynomial.polynomial.polyvander(x, 3)
    curve = np.linalg.lstsq(powers, base @ coefficients, rcond=None)[0]
    slope = np.polynomial.polynomial.polyval(x, np.polynomial.polynomial.polyder(curve))
    return slope / max(float(own.std()), 1e-9)


def _moved(time: np.ndarray, own: np.ndarray, rows: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """(rows, K): delayed and low-passed angle minus the angle itself."""
    if len(time) < 2:
        return np.zeros((len(rows), len(cells)))
    result = np.empty((len(rows), len(cells)))
    factor = max(1, round(float(np.median(np.diff(time))) / STEP_S)) if len(time) > 1 else 1
    fine_time = time[0] + STEP_S * np.arange((len(time) - 1) * factor + 1)
    fine = np.interp(fine_time, time, own)
    at = np.searchsorted(fine_time, time[rows] - 1e-6)
    shifts = np.round(cells[:, 0] / STEP_S).astype(int)
    for tau in np.unique(cells[:, 1]):
        passed = fine if tau == 0 else _low_pass(fine, tau) if tau > 0 else _low_pass(fine[::-1], -tau)[::-1]
        some = np.flatnonzero(cells[:, 1] == tau)
        index = np.clip(at[:, None] - shifts[None, some], 0, len(fine) - 1)
        result[:, some] = passed[index] - own[rows, None]
    return result


def _low_pass(signal: np.ndarray, tau: float) -> np.ndarray:
    """First order, exact for straight lines between the samples; starts at rest."""
    h = STEP_S / tau
    e = np.exp(-h)
    gain = (1 - e) / h
    return lfilter([1 - gain, gain - e], [1, -e], signal - signal[0]) + signal[0]
