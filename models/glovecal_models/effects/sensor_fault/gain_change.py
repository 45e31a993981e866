"""A sensor that answers more or less from one moment of the session on: a film that cracked.

It may be too small, or too near the end of a take, to be seen as a jump. The slopes of the takes show it: of
what the reading has beyond its usual curve, against the angle. A glove that slips changes offsets, and no
slopes. One change for good must explain the slopes beyond chance, and still do so beside the wearings, a
steady drift and any recorded column. A change just where the glove was put on again may as well be of the
donning: it is not named.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from glovecal_models.effects.sensor_fault.short_faults import straight_line
from glovecal_models.takes.take import Take

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
    change = _changed(len(used), before, after)
    for rival in _rivals([takes[n] for n in used]):
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


def _rivals(takes: Sequence[Take]) -> Iterator[np.ndarray]:
    """(T, K) of each cause that may change slopes too: the wearings, a steady drift, and columns that all
    takes know."""
    wearings = np.array([take.wearing for take in takes])
    yield np.column_stack([wearings == name for name in dict.fromkeys(wearings.tolist())]).astype(float)
    yield np.vander(np.arange(len(takes)) / len(takes), 2)
    for name in sorted(set.intersection(*(set(take.context) for take in takes))):
        values = [take.context[name][np.isfinite(take.context[name])] for take in takes]
        if all(map(len, values)):
            level = np.array([part.mean() for part in values])
            unit = max(float(level.std()), 1e-12)
            yield np.vander((level - level.mean()) / unit, 3)
