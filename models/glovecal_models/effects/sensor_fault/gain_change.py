"""A sensor that answers more or less from one moment of the session on: a film that cracked.

It may be too small, or too near the end of a take, to be seen as a jump. The slopes of the takes show it: of
what the reading has beyond its usual curve, against the angle. A glove that slips mostly changes offsets; a
sheath that turns changes slopes while it is worn. One change for good must explain the slopes beyond chance,
and still do so beside the wearings, a steady drift, one in each wearing, any recorded column and how fast the
joint moved, as a sensor that is late answers less to fast swings. A change just where the glove was put on
again may as well be of the donning: it is not named.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from glovecal_models.effects.sensor_fault.short_faults import straight_line
from glovecal_models.takes.take import Take
from glovecal_models.takes.take_check import GAP_INTERVALS

CURVE_DEGREE = 5
"""Of the usual reading along the angle."""
FEWEST_ON_A_SIDE = 2
TAKES_BEYOND_NUMBERS = 4
"""Takes beyond the numbers that are fitted to them."""
FRAMES_FOR_A_SLOPE = 50
LEAST_SPREAD_DEG = 1.0
CHANGE_P_VALUE = 0.001
"""That slopes which do not change look so, all moments and sensors counted (Bonferroni)."""
INSIDE_P_VALUE = 0.05
"""That a take whose slope is between both is so by chance."""
LEAST_SHARE = 0.02
"""Of the usual slope: less is within what a curve through a whole session leaves. A film that cracked in
simulated gloves changed it by 3 percent, a supply whose sag the base had not yet, by 1."""
SPEED_OVER_S = 0.1
"""Longer than the noise of a reference, shorter than a swing."""
BESIDE_P_VALUE = 0.005
"""That the change explains by chance so much of what the wearings, or a column, leave."""


@dataclass(frozen=True)
class GainChange:
    """Where and how much."""

    before: int
    """The last take before it."""
    after: int
    """The first take after it; one between both holds the change."""
    size_deg: float
    """By how much the answer to one standard deviation of the angles changes."""
    share: float
    """The same as a share of the usual slope, with its sign."""
    p_value: float


def gain_change(
    takes: Sequence[Take], readings: Sequence[np.ndarray], angles: Sequence[np.ndarray], sensors: int
) -> GainChange | None:
    """The change of one of so many ``sensors``, or None; takes in the order in which they were recorded.

    ``readings`` (N,) counts and ``angles`` (N,) degrees of each take, NaN where they are not to be used.
    """
    rows = [np.isfinite(angle) for angle in angles]
    used = [
        number
        for number, known in enumerate(rows)
        if known.sum() >= FRAMES_FOR_A_SLOPE and angles[number][known].std() > LEAST_SPREAD_DEG
    ]
    moments = list(_moments(len(used)))
    if not moments:
        return None
    slopes = _Slopes.of([readings[n][rows[n]] for n in used], [angles[n][rows[n]] for n in used])
    if slopes is None:
        return None
    before, after = _best_moment(slopes, moments)
    best = slopes.fitted(_changed(len(used), before, after))
    chance = best.p_value_over(slopes.fitted(np.ones((len(used), 1))))
    p_value = min(1.0, chance * len(moments) * sensors)
    if p_value > CHANGE_P_VALUE or abs(best.second) < LEAST_SHARE:
        return None
    change, speeds = _changed(len(used), before, after), [_speed(takes[n].time_s, angles[n]) for n in used]
    for rival in _rivals([takes[n] for n in used], np.array(speeds)):
        # The take that holds the change, if any, speaks for neither.
        without = slopes.fitted(np.column_stack([rival, change[:, 2:]]))
        beside = slopes.fitted(np.column_stack([rival, change[:, 1:]]))
        if beside.p_value_over(without) > BESIDE_P_VALUE:
            return None
    return GainChange(used[before], used[after], abs(best.second) * slopes.unit_deg, best.second, p_value)


@dataclass(frozen=True)
class _Fit:
    """What columns leave of the takes' slopes."""

    squares: float
    numbers: int
    free: int
    second: float
    """The second column's weight; 0 without one."""

    @property
    def variance(self) -> float:
        return self.squares / max(self.free, 1)

    def p_value_over(self, smaller: _Fit) -> float:
        """That columns added to those of ``smaller`` explain so much by chance; 1 where they add nothing, or
        where no take is left to judge."""
        added = self.numbers - smaller.numbers
        if added < 1 or self.free < 1:
            return 1.0
        explained = (smaller.squares - self.squares) / added
        return float(fdtrc(added, self.free, explained / max(self.variance, 1e-300)))


@dataclass(frozen=True)
class _Slopes:
    """Of T takes, as shares of the usual slope beyond it."""

    values: np.ndarray
    roots: np.ndarray
    """(T,) square roots of how much each take tells: of the variance of its angles."""
    unit_deg: float
    """Standard deviation of all angles."""

    @classmethod
    def of(cls, readings: Sequence[np.ndarray], angles: Sequence[np.ndarray]) -> _Slopes | None:
        every, counts = np.concatenate(angles), np.concatenate(readings)
        centre, spread = float(every.mean()), float(every.std())
        usual = straight_line(every, counts)[0]
        if usual == 0.0:
            return None
        powers = np.ones((CURVE_DEGREE + 1, len(every)))
        place = (every - centre) / (2.0 * spread)
        for number in range(1, len(powers)):
            np.multiply(powers[number - 1], place, out=powers[number])
        curve = np.linalg.lstsq(powers @ powers.T, powers @ counts, rcond=None)[0]
        left = np.split(counts - curve @ powers, np.cumsum([len(angle) for angle in angles])[:-1])
        values = [straight_line(*pair)[0] / usual for pair in zip(angles, left, strict=True)]
        return cls(np.array(values), np.array([angle.std() for angle in angles]), spread)

    def fitted(self, columns: np.ndarray) -> _Fit:
        """By weighted least squares of (T, K) columns."""
        scaled, target = columns * self.roots[:, None], self.values * self.roots
        weights, _, rank, _ = np.linalg.lstsq(scaled, target, rcond=None)
        left = target - scaled @ weights
        second = float(weights[1]) if len(weights) > 1 else 0.0
        return _Fit(float(left @ left), int(rank), len(target) - int(rank), second)


def _moments(takes: int) -> Iterator[tuple[int, int]]:
    """The last take before a change and the first after it, next to each other or with one between."""
    for before in range(FEWEST_ON_A_SIDE - 1, takes):
        for after in (before + 1, before + 2):
            if takes - after >= FEWEST_ON_A_SIDE and takes - 1 - (after - before) >= TAKES_BEYOND_NUMBERS:
                yield before, after


def _best_moment(slopes: _Slopes, moments: Sequence[tuple[int, int]]) -> tuple[int, int]:
    """That which leaves least; inside a take only where a moment beside it leaves significantly more."""
    takes = len(slopes.values)
    fits = {at: slopes.fitted(_changed(takes, *at)) for at in moments}
    between = min((at for at in moments if at[1] == at[0] + 1), key=lambda at: fits[at].squares)
    inside = min(
        (at for at in moments if at[1] > at[0] + 1), key=lambda at: fits[at].squares, default=between
    )
    is_inside = fits[inside].p_value_over(fits[between]) <= INSIDE_P_VALUE
    return inside if is_inside else between


def _changed(takes: int, before: int, after: int) -> np.ndarray:
    """(T, K): a constant, the change, and where a take holds the change one column for it alone."""
    place = np.arange(takes)
    columns = [np.ones(takes), place >= after]
    if after - before > 1:
        columns.append((place > before) & (place < after))
    return np.column_stack(columns).astype(float)


def _rivals(takes: Sequence[Take], speeds: np.ndarray) -> Iterator[np.ndarray]:
    """(T, K) of each cause that may change slopes too: the wearings, alone and with a slip that goes the same
    way in each, a steady drift, the ``speeds`` (T,), and columns that all takes know."""
    names = [take.wearing for take in takes]
    each = np.array([[name == wearing for wearing in dict.fromkeys(names)] for name in names], float)
    yield each
    since_donned = np.array([names[:number].count(name) for number, name in enumerate(names)])
    yield np.column_stack([each, _curve(since_donned)[:, :2]])
    yield np.vander(np.arange(len(takes)) / len(takes), 2)
    yield _curve(speeds)
    for name in sorted(set.intersection(*(set(take.context) for take in takes))):
        values = [take.context[name][np.isfinite(take.context[name])] for take in takes]
        if all(map(len, values)):
            yield _curve(np.array([part.mean() for part in values]))


def _curve(levels: np.ndarray) -> np.ndarray:
    """(T, 3) of T numbers."""
    return np.vander((levels - levels.mean()) / max(float(levels.std()), 1e-12), 3)


def _speed(time_s: np.ndarray, angle: np.ndarray) -> float:
    """The mean square of a joint's angular frequency (1/s²): by so much, times half its square, a delay
    lessens the slope. ``angle`` (N,) has at least one spread."""
    step = max(round(SPEED_OVER_S / float(np.median(np.diff(time_s)))), 1)
    changes = (angle[step:] - angle[:-step]) / (time_s[step:] - time_s[:-step])
    changes = changes[np.isfinite(changes)]
    return float(np.mean(changes**2) / np.nanvar(angle)) if len(changes) else 0.0


# A jump of gain or offset in the middle of a take: a plug that moved, an amplifier that switched. The
# reading is fitted by a line in the reference. One line for the whole take, one line on each side of the
# best moment, and one line that changes steadily with time: a jump is named only when two lines leave far
# less than both others, and when the error steps right there from one frame to the next, as it does nowhere
# else, and stays where it stepped to: noise comes back with the next frame. Postures that are held one
# after another also look like two lines, but no hand changes posture in a frame.


SHORTEST_SIDE_S = 4.0
SEARCHED_FRAMES = 12
"""The best moment for two lines may be so far from the step."""
LEAST_DEG = 3.0
BETTER_THAN_ONE = 0.5
"""Share of the squared error of one line that two may leave."""
BETTER_THAN_DRIFT = 0.7
STEP_SHARE = 0.5
"""Of the change between the two lines at that angle: so much the step must reach, and the error keep."""
TYPICAL_SHARE = 0.7
"""Of the RMS of that change over the take, which the change at the step must reach."""
STEP_OVER_OTHERS = 1.3
"""The step over the largest ones elsewhere in the take (99.5 %)."""
AROUND_FRAMES = 6
STEP_OVER_AROUND = 2.0
"""The step over any other within so many frames: a quick movement takes several."""


@dataclass(frozen=True)
class GainJump:
    """Where and how much."""

    at_s: float
    size_deg: float
    """RMS of what the reading changes by over the take's angles, degrees."""


def gain_jump(
    time_s: np.ndarray, readings: np.ndarray, angles: np.ndarray, in_line: np.ndarray
) -> GainJump | None:
    """The largest jump of (N,) readings against (N,) reference degrees (NaN: not to be used), or None.

    ``in_line`` (N,) is False where a sensor may be saturated: such frames may show the step, but no line.
    """
    known = np.isfinite(angles) & in_line
    time, y, angle = time_s[known], readings[known], angles[known]
    if len(time) < 50 or time[-1] - time[0] < 2 * SHORTEST_SIDE_S or np.ptp(angle) < LEAST_DEG:
        return None
    spread = float(angle.std())
    x = (angle - angle.mean()) / spread
    answer, rest = straight_line(x, y)
    one = float(np.sum((y - answer * x - rest) ** 2))
    slope = abs(answer) / spread
    cut, two = _best_cut(time, x, y)
    if cut is None or slope <= 0 or two > BETTER_THAN_ONE * one:
        return None
    base = np.column_stack([np.ones_like(x), x])
    place = (2 * (time - time[0]) / (time[-1] - time[0]) - 1)[:, None]
    if two > BETTER_THAN_DRIFT * _left(np.column_stack([base, base * place]), y):
        return None
    before, after = (np.linalg.lstsq(base[side], y[side], rcond=None)[0] for side in _sides(cut, len(y)))
    change = base @ (after - before)
    # The slope across a jump mixes both sides; that of each side alone is the sensor's.
    slope = max(slope, 0.5 * (abs(before[1]) + abs(after[1])) / spread)
    size = float(np.sqrt(np.mean(change**2)) / slope)
    if size < LEAST_DEG:
        return None
    shown = np.isfinite(angles)
    every = np.column_stack([np.ones(shown.sum()), (angles[shown] - angle.mean()) / spread])
    error, change = readings[shown] - every @ before, every @ (after - before)
    at = int(np.searchsorted(time_s[shown], time[cut]))
    if not _is_abrupt(time_s[shown], error, readings[shown], change, at):
        return None
    return GainJump(float(time[cut]), size)


def _sides(cut: int, frames: int) -> tuple[slice, slice]:
    return slice(0, cut), slice(cut, frames)


def _left(columns: np.ndarray, y: np.ndarray) -> float:
    """Squared error of least squares."""
    weights = np.linalg.lstsq(columns, y, rcond=None)[0]
    return float(np.sum((y - columns @ weights) ** 2))


def _best_cut(time: np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[int | None, float]:
    """The frame that starts the second line, and the squared error of both; from running sums."""
    centred = y - y.mean()
    terms = np.stack([np.ones_like(x), x, x * x, centred, x * centred, centred * centred])
    before = np.cumsum(terms, axis=1)
    left = _line_left(before) + _line_left(before[:, -1:] - before)
    allowed = (time - time[0] >= SHORTEST_SIDE_S) & (time[-1] - time >= SHORTEST_SIDE_S)
    if not allowed.any():
        return None, np.inf
    best = int(np.argmin(np.where(allowed, left, np.inf)))
    return best + 1, float(left[best])


def _line_left(sums: np.ndarray) -> np.ndarray:
    """Squared error of a line from the sums of 1, x, x², y, xy, y²."""
    n, x, xx, y, xy, yy = sums
    n = np.maximum(n, 1.0)
    sxx, sxy, syy = xx - x * x / n, xy - x * y / n, yy - y * y / n
    return np.maximum(syy - np.where(sxx > 1e-9, sxy**2 / np.maximum(sxx, 1e-9), 0.0), 0.0)


def _is_abrupt(
    time: np.ndarray, error: np.ndarray, readings: np.ndarray, change: np.ndarray, cut: int
) -> bool:
    """Whether the error against the first line, and the reading, step near the cut by what the lines differ
    there; where the reading does not, the reference jumps."""
    elapsed = np.diff(time, prepend=time[:1])
    # Across frames that were left out a movement looks like a step.
    adjacent = elapsed <= GAP_INTERVALS * float(np.median(elapsed))
    steps = np.where(adjacent, np.abs(np.diff(error, prepend=error[:1])), 0.0)
    near = np.abs(np.arange(len(error)) - cut) <= SEARCHED_FRAMES
    at = int(np.argmax(np.where(near, steps, -1.0)))
    # Where the two lines cross, no step could be seen, and none is believed.
    typical = float(np.sqrt(np.mean(change**2)))
    expected = max(float(np.abs(change[near]).max()), TYPICAL_SHARE * typical)
    before, after = slice(max(at - AROUND_FRAMES, 0), at), slice(at, at + AROUND_FRAMES)
    around = np.concatenate([steps[before], steps[at + 1 : at + 1 + AROUND_FRAMES]])
    kept = abs(float(np.median(error[after]) - np.median(error[before]))) if at else 0.0
    if kept < STEP_SHARE * expected or not at:
        return False
    if (readings[at] - readings[at - 1]) * np.sign(error[at] - error[at - 1]) < STEP_SHARE * steps[at]:
        return False
    limit = max(
        STEP_SHARE * expected,
        STEP_OVER_OTHERS * float(np.percentile(steps[~near], 99.5)),
        STEP_OVER_AROUND * float(around.max()),
    )
    return bool(steps[at] >= limit)
