"""Which delay it is: a lag, clocks that disagree, or a glove that is late as a whole.

A reading that comes before the angle can only come from the clocks, and so can a delay that differs from take
to take. Joints that differ are a mark of a lag: a transport and a clock delay all alike. Otherwise the form
decides, by what it leaves of the error: filters flatten fast motion, a mere delay does not. Clocks and a
transport are the same in every take; only a latency that was measured tells them apart. Forms are judged by
what they gain more where motion is fast: a low pass gains everywhere by taking noise from the reference.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.effects.base.assessment import over_joints
from glovecal_models.effects.base.comparison import Problem
from glovecal_models.effects.base.limits import SIGNIFICANCE_LIMITS, SignificanceLimits
from glovecal_models.effects.delay.delay_grid import DelayErrors, DelayForm, delay_errors, short_delay_errors
from glovecal_models.effects.delay.delay_spread import DelaySpread, delay_spread
from glovecal_models.takes.take import KnownLatency
from glovecal_models.takes.tap_latency import usual_key

SMOOTHING = 13
"""Even times."""

LAG, CLOCK, LATENCY = "lag", "clock_offset", "glove_latency"
APART_TIMES = 1.5
"""Delays of one size for all joints reach 2.3 standard errors (24 simulated gloves), lags of several sizes
mostly 6 to 17."""
SLOW_MOTION_SHARE = 0.3
"""Of the mean motion: blocks with less count alike."""
MEASURED_SE = 2.0
"""A measured latency and a delay of takes this many standard errors apart are two different times."""
ASKED_SE = 3.0
"""Taps are asked for where the delay of takes is so many: it will hardly come out in between."""
FAST_DECIDES_S = 0.01
"""How a shorter delay spreads is as uncertain as the difference between its forms: of 5 to 8 ms to 0.3 to
0.9, two standard errors (eight simulated lags, 2026-11-29)."""
STOP_SD_S = 0.003
"""Taps find the finger's stop 2 to 4 ms late (simulated)."""
ACCOUNTS_FOR = {
    DelayForm.PURE: (CLOCK, LATENCY),
    DelayForm.ONE_POLE: (LAG,),
    DelayForm.TWO_POLES: (LAG,),
    DelayForm.MOVING_AVERAGE: (LAG, LATENCY),
    DelayForm.DELAYED_WINDOW: (LATENCY, LAG),
}
"""The likelier first; a symmetric filter may be in the sensors' electronics or on the way."""


@dataclass(frozen=True)
class ClockChoice:
    """The offset that explains most."""

    offset_s: np.ndarray
    """(1,) for all takes, or (takes,)."""
    cell: np.ndarray
    """(takes,) index among the cells of a mere delay, of each take."""
    within: Sequence[np.ndarray] | None = None
    """For each joint (B,) the cell in each block, where the offset changes within takes."""

    @property
    def is_per_take(self) -> bool:
        return len(self.offset_s) > 1

    def errors(self, grids: Sequence[DelayErrors]) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """For each joint (B,): squared errors with the offset, and with the mirrored one."""
        size = len(grids[0].clock)
        true, mirrored = [], []
        for joint, grid in enumerate(grids):
            rows = np.arange(len(grid.take))
            cell = self.cell[grid.take] if self.within is None else self.within[joint]
            true.append(grid.blocks[rows, grid.clock[cell]])
            mirrored.append(grid.blocks[rows, grid.clock[size - 1 - cell]])
        return true, mirrored


def clock_choice(
    grids: Sequence[DelayErrors], limits: SignificanceLimits = SIGNIFICANCE_LIMITS
) -> ClockChoice:
    """One offset for all takes, unless their own save clearly more (each judged on other blocks), or one that
    changes within takes does (judged on the joints that it was not found by)."""
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
    delays = grids[0].delay_s[clock]
    is_per_take = takes > 1 and gain > limits.per_take_offset_share * len(grids)
    cells = own if is_per_take else np.full(takes, common)
    within = cells_of_others(grids)
    if within is not None:
        shares = [part[np.arange(len(part)), cell] for part, cell in zip(share, within, strict=True)]
        left = sum(float(part.sum()) for part in shares)
        saved = sum(float(part[np.arange(len(part)), cells[grid.take]].sum())
                    for part, grid in zip(share, grids, strict=True)) - left  # fmt: skip
        if saved > limits.within_take_offset_share * len(grids):
            return ClockChoice(delays[own], own, within)
    return ClockChoice(delays[own] if is_per_take else delays[[common]], cells)


def common_choice(grids: Sequence[DelayErrors]) -> ClockChoice:
    """The delay of all takes that explains most, never an advance."""
    clock, takes = grids[0].clock, int(max(grid.take.max() for grid in grids)) + 1
    total = sum(grid.blocks[:, clock].sum(axis=0) / grid.whole for grid in grids)
    delays = grids[0].delay_s[clock]
    best = int(np.argmin(np.where(delays > -1e-9, total, np.inf)))
    return ClockChoice(np.abs(delays[[best]]), np.full(takes, best))


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
    usual = problem(SMOOTHING)
    grids = delay_errors(usual)
    possible = possible_delays(
        grids, usual.limits, lambda: short_delay_errors(usual), lambda late_s: delay_spread(usual, late_s)
    )
    latency = usual.signals[0].glove_latency
    if latency is not None and CLOCK in possible:
        possible = _told_by_latency(possible, common_delay(grids), latency)
    return possible[0], possible


def possible_delays(
    grids: Sequence[DelayErrors],
    limits: SignificanceLimits = SIGNIFICANCE_LIMITS,
    in_short_blocks: Callable[[], Sequence[DelayErrors]] | None = None,
    spread_of: Callable[[float], DelaySpread | None] = lambda late_s: None,
) -> tuple[str, ...]:
    """The effects that these delays may come from, the likeliest first. ``in_short_blocks``: gives the same
    errors for forms to be told apart by; ``spread_of``: how a delay of so many seconds spreads."""
    clear = limits.delay_clear_se
    clock = clock_choice(grids, limits)
    if np.median(clock.offset_s) < 0 or clock.within is not None:
        return (CLOCK,)
    together = {form: _together(grids, form) for form in DelayForm}
    if clock.is_per_take:
        each_take = _over_joints(grids, clock.errors(grids)[0])
        if min(_score(errors, each_take) for errors in together.values()) > clear:
            return (CLOCK,)
    late_s = common_delay(grids).seconds
    spread = spread_of(late_s) if late_s >= FAST_DECIDES_S else None
    if _score(together[DelayForm.PURE], _apart(grids, DelayForm.PURE)) > APART_TIMES * clear:
        # A glove that reads one sensor after another is late by another time at each.
        return (LATENCY,) if spread is not None and spread.is_mere_delay else (LAG,)
    kept = forms_kept(grids, together, clear)
    if in_short_blocks and len(kept) > 1:
        short = in_short_blocks()
        also = forms_kept(short, {form: _together(short, form) for form in DelayForm}, clear)
        kept = [form for form in kept if form in also] or kept
    if spread is not None:
        kept = [form for form in kept if spread.may_be(form)] or kept
        if DelayForm.DELAYED_WINDOW in kept and spread.may_be(DelayForm.PURE):
            kept.append(DelayForm.PURE)  # noise of the reference, too, makes a window of a mere delay
    if DelayForm.PURE in kept and DelayForm.DELAYED_WINDOW in kept:
        kept.remove(DelayForm.DELAYED_WINDOW)  # hardly told from a mere delay
    # A filter may gain by what noise it takes away: while a mere delay is not ruled out, it comes first.
    kept.sort(key=lambda form: form is not DelayForm.PURE)
    return tuple(dict.fromkeys(name for form in kept for name in ACCOUNTS_FOR[form]))


def forms_kept(
    grids: Sequence[DelayErrors], together: dict[DelayForm, np.ndarray], clear_se: float
) -> list[DelayForm]:
    """Forms that are not ruled out, the best first, from their errors (B,).

    A filter also takes noise from the reference, in every block alike: only what it gains more where motion
    is fast is held for it.
    """
    fast = _over_joints(grids, [grid.fast for grid in grids])
    gain = {form: _along(together[DelayForm.PURE] - together[form], fast)[0] for form in DelayForm}
    order = sorted(DelayForm, key=lambda form: -gain[form])
    best = together[order[0]]
    kept = []
    for form in order:
        slope, error = _along(together[form] - best, fast)
        if slope <= clear_se * error:
            kept.append(form)
    return kept


def _along(gain: np.ndarray, fast: np.ndarray) -> tuple[float, float]:
    """Slope of the straight line of ``gain`` (B,) over ``fast`` (B,), and its standard error.

    Scatter grows with motion, so that slow blocks count more; the error holds for any scatter.
    """
    x = fast / max(float(fast.mean()), 1e-12)
    weight = 1.0 / (x + SLOW_MOTION_SHARE) ** 2
    x = x - np.average(x, weights=weight)
    square = float(weight @ (x * x))
    if len(x) < 3 or square <= 0:
        return 0.0, np.inf
    slope = float((weight * x) @ gain) / square
    left = gain - np.average(gain, weights=weight) - slope * x
    left = left / np.maximum(1.0 - weight / weight.sum() - weight * x * x / square, 1e-3)
    return slope, float(np.sqrt(np.sum((weight * x * left) ** 2))) / square


@dataclass(frozen=True)
class CommonDelay:
    """One delay of all joints and takes, as a mere delay."""

    seconds: float
    se_s: float
    """Standard error, by leaving out take after take."""


def common_delay(grids: Sequence[DelayErrors]) -> CommonDelay:
    """How much later than the reference the readings come."""
    cells = grids[0].clock
    delay, takes = grids[0].delay_s[cells], int(max(grid.take.max() for grid in grids)) + 1
    each = np.array(
        [
            sum(grid.blocks[grid.take == take][:, cells].sum(axis=0) / grid.whole for grid in grids)
            for take in range(takes)
        ]
    )
    whole = each.sum(axis=0)
    without = np.array([_least(whole - part, delay).at(delay) for part in each if part.any()])
    spread = np.sqrt((len(without) - 1) * without.var()) if len(without) > 1 else np.inf
    return CommonDelay(_least(whole, delay).at(delay), float(spread))


def if_the_glove_is_late(late_s: float, confidence_set: Sequence[str]) -> str:
    """What follows for live poses, as a sentence; "" where no glove can be late."""
    if LATENCY not in confidence_set or late_s <= 0:
        return ""
    if len(confidence_set) == 1:
        return f"Live poses are {1000 * late_s:.0f} ms late; their time and age say so."
    if not taps_decide(late_s, None):
        return (
            f"If it is the glove, live poses are {1000 * late_s:.0f} ms late: too little for taps on a key to"
            f" decide, as keys report a press 5 to 20 ms late."
        )
    return (
        f"If it is the glove, live poses are {1000 * late_s:.0f} ms late. This measures the glove's own"
        " delay and decides: glovecal take latency GLOVE."
    )


def taps_decide(late_s: float, latency: KnownLatency | None) -> bool:
    """Whether a glove that is ``late_s`` late, and one that is not, can be told by taps on a key, where
    ``latency`` is what was measured before."""
    return latency is None and abs(late_s) > ASKED_SE * float(np.hypot(STOP_SD_S, usual_key()[1]))


def _told_by_latency(possible: tuple[str, ...], delay: CommonDelay, latency: KnownLatency) -> tuple[str, ...]:
    """``possible`` with what a measured latency rules out left out.

    A glove that is as late as its readings says that the clocks agree, and another latency that they do not:
    what taps measure holds the sensors' lag too.
    """
    within = MEASURED_SE * float(np.linalg.norm((delay.se_s, latency.sd_s, STOP_SD_S)))
    if abs(delay.seconds - latency.seconds) <= within:
        if abs(delay.seconds) <= within:
            return possible
        if LATENCY not in possible:  # what differs from take to take may be either
            return (LATENCY, *possible)
        left = tuple(name for name in possible if name != CLOCK)
        return (LATENCY, *(name for name in left if name != LATENCY))
    return (CLOCK,)


@dataclass(frozen=True)
class _Least:
    """The least of a curve over rising cells, between them."""

    cells: np.ndarray
    """Three neighbours; one at an end of the curve."""
    weights: np.ndarray
    """Of their values in that of the parabola through them, where it is least."""

    def at(self, values: np.ndarray) -> float:
        return float(values[self.cells] @ self.weights)


def _least(curve: np.ndarray, delay_s: np.ndarray) -> _Least:
    """Of the parabola through the least of ``curve`` (K,) at ``delay_s`` (K,) and its neighbours.

    Cells are up to 10 ms apart, and long takes tell one from two.
    """
    at = int(np.argmin(curve))
    if at in (0, len(curve) - 1):
        return _Least(np.array([at]), np.ones(1))
    cells = np.arange(at - 1, at + 2)
    x = delay_s[cells] - delay_s[at]
    slope, bend = np.linalg.solve(x[[0, 2], None] ** [1, 2], curve[cells[[0, 2]]] - curve[at])
    least = -slope / (2 * bend) if bend > 0 else 0.0
    others = [[1, 2], [0, 2], [0, 1]]
    return _Least(cells, np.prod((least - x[others]) / (x[:, None] - x[others]), axis=1))


def _forward(grid: DelayErrors, form: DelayForm) -> np.ndarray:
    """Cells of a form that are late, or not at all."""
    cells = grid.cells(form)
    return cells[grid.delay_s[cells] >= -1e-9]


def _together(grids: Sequence[DelayErrors], form: DelayForm) -> np.ndarray:
    """(B,) shares of the error with one delay for all joints."""
    every = _over_joints(grids, [grid.blocks[:, _forward(grid, form)] for grid in grids])
    least = _least(every.sum(axis=0), grids[0].delay_s[_forward(grids[0], form)])
    return every[:, least.cells] @ least.weights


def _apart(grids: Sequence[DelayErrors], form: DelayForm) -> np.ndarray:
    """(B,) shares of the error with a delay of each joint."""
    found = []
    for grid in grids:
        cells = _forward(grid, form)
        blocks = grid.blocks[:, cells]
        least = _least(blocks.sum(axis=0), grid.delay_s[cells])
        found.append(blocks[:, least.cells] @ least.weights)
    return _over_joints(grids, found)


def _over_joints(grids: Sequence[DelayErrors], errors: Sequence[np.ndarray]) -> np.ndarray:
    """``errors`` (B, ...) of each joint as shares of its error, summed over joints."""
    shares = [part / grid.whole for grid, part in zip(grids, errors, strict=True)]
    return over_joints(shares, [grid.take for grid in grids])


def _score(worse: np.ndarray, better: np.ndarray) -> float:
    """How much more error ``worse`` (B,) leaves than ``better``, in standard errors."""
    gain = worse - better
    if len(gain) < 2:
        return 0.0
    return float(gain.mean() / max(gain.std(ddof=1) / np.sqrt(len(gain)), 1e-12))


# A clock whose offset changes within takes: for each block of time the offset that the other joints want. A
# clock is off for all joints alike. So the path of one joint's offset through the blocks of a take is the
# likeliest one of all other joints together (Viterbi 1967), where a change of the offset costs in
# proportion to its size; what it leaves of this joint's error was not fitted to it.


FEWEST_JOINTS = 3
ROWS_ALIKE = 8
"""Neighbouring rows of smoothed signals say nearly the same."""
NATS_A_SECOND = 200.0
"""Of the log likelihood, for a change of the offset by a second: two for 10 ms."""


def cells_of_others(grids: Sequence[DelayErrors]) -> list[np.ndarray] | None:
    """For each joint (B,) the cell among those of a mere delay in each block; None where joints have other
    blocks than each other, or are too few."""
    takes = grids[0].take
    if len(grids) < FEWEST_JOINTS or any(not np.array_equal(grid.take, takes) for grid in grids):
        return None
    cost = np.array([_nats(grid) for grid in grids])
    every = cost.sum(axis=0)
    delay_s = grids[0].delay_s[grids[0].clock]
    change = NATS_A_SECOND * np.abs(delay_s[:, None] - delay_s[None, :])
    return [_likeliest(every - own, takes, change) for own in cost]


def _nats(grid: DelayErrors) -> np.ndarray:
    """(B, K): what each cell costs in each block."""
    blocks = grid.blocks[:, grid.clock]
    least = blocks.min(axis=1).sum()
    rows = max(grid.rows, 1)
    return blocks * (0.5 * rows / ROWS_ALIKE / max(float(least), 1e-12))


def _likeliest(cost: np.ndarray, takes: np.ndarray, change: np.ndarray) -> np.ndarray:
    """(B,) of the cheapest path through ``cost`` (B, K), anew in each take."""
    found = np.empty(len(cost), dtype=int)
    for take in np.unique(takes):
        rows = np.flatnonzero(takes == take)
        so_far, came_from = cost[rows[0]], []
        for row in rows[1:]:
            step = so_far[:, None] + change
            came_from.append(step.argmin(axis=0))
            so_far = step.min(axis=0) + cost[row]
        cell = int(so_far.argmin())
        found[rows[-1]] = cell
        for row, before in zip(rows[-2::-1], came_from[::-1], strict=True):
            cell = int(before[cell])
            found[row] = cell
    return found
