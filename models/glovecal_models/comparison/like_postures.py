"""Takes of one wearing held against each other where their joints stand alike.

A line through takes with different motions says little of one that moves elsewhere. Where two takes go
through the same angles, their sensors read the same, whatever the map between them is: of a take whose
readings there are another take's only once two columns are exchanged, the columns are exchanged. Every other
take of the wearing has to say so. Nothing is asked of postures that no other take has.

A reference that wanders slowly against the sensors, in one take of several.

All takes share one map with squares and products of their sensors, and each has a level of its own. Of each
take and rotation it is asked how much of what the map leaves a slow change with time takes away. A warm-up,
creep or a slip change with time too: they do so in most takes, or on the one sensor of a joint, of which
nothing is said here: only where more sensors than rotations see the hand do they bear witness.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, combinations_with_replacement
from typing import Literal

import numpy as np

from glovecal_models.comparison.limits import ComparisonLimits
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

MOST_POSTURES = 120
"""Of a take, evenly."""
FEWEST_LIKE_ROWS = 8
"""Of a take that stand like rows of another."""
FEWEST_OTHERS, FEWEST_TAKES = 2, 3
ALIKE_ANGLE_DEG, ALIKE_ANGLE_SHARE = 3.0, 0.1
"""Angles alike, in degrees and of the standard deviation over all takes."""
MOST_HELD_ALIKE, MOST_EXCHANGED = 6, 3
"""Of more, hardly any two postures are alike in all; and some pair of rotations fits by chance."""
LEAST_MOVED_WITHIN_DEG = 3.0
"""Of a hand that moves less within takes, readings tell the hand's rest."""
ONE_IS_ENOUGH = 0.25
"""Times the share that exchanging may leave: then one other take is enough, which others agree with."""


How = Literal[
    "shift", "signs", "sensors", "rotations", "columns", "gains", "own map", "level", "wandering", "nothing"
]
OTHER_LEVEL = "Its readings lie elsewhere at the same angles. Another person, another glove, or another zero?"
FEWEST_SLOW_ROWS, MOST_SLOW_ROWS = 40, 300
MOST_WITH_PRODUCTS = 6
"""Sensors; of more, lines alone."""
SLOW_RIDGE = 1e-5
TIMES_AS_MANY = 2
"""Sensors as rotations."""
SHORTEST_SLOW_S = 4.0
"""In a shorter take a slow change is the movement itself."""


@dataclass(frozen=True)
class OddTake:
    """A take that does not fit the others."""

    place: int
    """Of the take among those that were looked at."""
    take: str
    error_deg: float
    """Of a line through the other takes, RMS over rotations, offsets taken away."""
    usual_deg: float
    """The same of the other takes, at most."""
    how: How
    """What makes it fit."""
    fitted_deg: float
    """Its error then."""
    change: str
    """What makes it fit, as a part of a sentence."""
    in_like_postures: bool = False
    """Whether errors are of readings where joints stand alike, as degrees that move them as far; else of a
    line."""

    @property
    def sentence(self) -> str:
        start = f"Take {self.take!r} does not fit the others: "
        if self.how == "wandering":
            return f"{start}{self.change}"
        if self.in_like_postures:
            start += (
                f"where joints stand alike, its readings are as far from theirs as {self.error_deg:.1f}"
                f" degrees move them; theirs are at most {self.usual_deg:.1f} apart."
            )
        else:
            start += (
                f"{self.error_deg:.1f} degrees off a line through them, which are at most"
                f" {self.usual_deg:.1f} off."
            )
        if self.how == "nothing":
            return f"{start} No change of columns, signs, gains or clock makes it fit."
        if self.how == "level":
            return f"{start} {self.change}"
        return f"{start} {self.change}; {self.fitted_deg:.1f} degrees then."

    @property
    def is_set_aside(self) -> bool:
        """A clock is repaired where it is found, by whoever asked: its take stays."""
        return self.how != "shift"

    @property
    def told(self) -> str:
        return f"{self.sentence} It is set aside." if self.is_set_aside else self.sentence


@dataclass(frozen=True)
class Unlike:
    """A take whose readings are not the others' where its joints stand alike."""

    place: int
    how: Literal["sensors", "rotations", "level"]
    names: tuple[str, ...]
    """The columns that are exchanged."""
    off_deg: float
    """As many degrees move the sensors as far."""
    usual_deg: float
    """The same of the other takes, at most."""
    fitted_deg: float
    """Once the columns are exchanged."""


def unlike_takes(
    takes: Sequence[Take], sensors: Sequence[str], layout: Layout, limits: ComparisonLimits
) -> list[Unlike]:
    """Those of any wearing, by ``sensors`` that are sound; fewer than half of each wearing's."""
    odd_ones = []
    for wearing in dict.fromkeys(take.wearing for take in takes):
        places = [
            place
            for place, take in enumerate(takes)
            if take.wearing == wearing and np.isfinite(take.reference).any()
        ]
        most = (len(places) - 1) // 2
        while most and len(places) > FEWEST_OTHERS:
            odd = _Wearing.of([takes[place] for place in places], sensors, layout.rotations).unlike(limits)
            if odd is None:
                break
            place = places.pop(odd.place)
            odd_ones.append(Unlike(place, odd.how, odd.names, odd.off_deg, odd.usual_deg, odd.fitted_deg))
            most -= 1
    return odd_ones


@dataclass(frozen=True)
class _Wearing:
    sensors: tuple[str, ...]
    rotations: tuple[str, ...]
    parts: tuple[tuple[np.ndarray, np.ndarray], ...]
    """Of each take readings (N, S) and angles (N, R)."""
    spread: np.ndarray
    """(S,) standard deviation within takes."""
    alike_deg: np.ndarray
    """(R,)."""
    spread_deg: float
    """RMS of the angles within takes."""

    @classmethod
    def of(cls, takes: Sequence[Take], sensors: Sequence[str], rotations: Sequence[str]) -> _Wearing:
        measured = [
            name
            for name in rotations
            if all(
                name in take.rotations and np.isfinite(take.reference[:, take.rotations.index(name)]).any()
                for take in takes
            )
        ]
        pairs = [_some(take, sensors, measured) for take in takes]
        every = np.concatenate([x - x.mean(axis=0) if len(x) else x for x, _ in pairs])
        spread = np.sqrt(np.mean(every**2, axis=0)) if len(every) else np.zeros(len(sensors))
        alive = spread > 0
        living = tuple(name for name, lives in zip(sensors, alive, strict=True) if lives)
        parts = tuple((x[:, alive], y) for x, y in pairs)
        angles = np.concatenate([y for _, y in parts])
        moved = angles.std(axis=0) if len(angles) else np.zeros(len(measured))
        within = np.concatenate([y - y.mean(axis=0) if len(y) else y for _, y in pairs])
        alike = np.maximum(ALIKE_ANGLE_DEG, ALIKE_ANGLE_SHARE * moved)
        usual = float(np.sqrt(np.mean(within**2))) if within.size else 0.0
        return cls(living, tuple(measured), parts, spread[alive], alike, usual)

    def unlike(self, limits: ComparisonLimits) -> Unlike | None:
        few = len(self.sensors) > 1 and 0 < len(self.rotations) <= MOST_HELD_ALIKE
        if not few or self.spread_deg < LEAST_MOVED_WITHIN_DEG:
            return None
        for asked in (self._sensors, self._rotations, self._levels):
            far = (item for item in asked(limits) if item[1].off_deg >= limits.odd_least_deg)
            odd_ones = min(far, key=lambda item: item[0], default=None)
            if odd_ones is not None:
                return odd_ones[1]
        return None

    @cached_property
    def squares(self) -> dict[tuple[int, int], np.ndarray]:
        """(S, S) mean squared difference of each sensor of one take from each of another, by their places;
        without takes that have no postures alike."""
        count = range(len(self.parts))
        odd_ones = {(i, j): self._squares(i, j) for i in count for j in count if i != j}
        return {key: value for key, value in odd_ones.items() if value is not None}

    def _squares(self, one: int, other: int, order: Sequence[int] | None = None) -> np.ndarray | None:
        """``order``: of the first take's rotations."""
        (x, y), (u, v) = self.parts[one], self.parts[other]
        y = y if order is None else y[:, order]
        near: np.ndarray = np.all(np.abs(y[:, None] - v[None]) <= self.alike_deg, axis=-1)
        has: np.ndarray = np.any(near, axis=-1)
        if has.sum() < FEWEST_LIKE_ROWS:
            return None
        theirs = near[has] @ u / near[has].sum(axis=1, keepdims=True)
        return ((x[has][:, :, None] - theirs[:, None, :]) ** 2).mean(axis=0)

    def _own(self, place: int) -> np.ndarray:
        """(takes, S) each sensor of a take against itself in the others."""
        return self._against_itself(value for (one, _), value in self.squares.items() if one == place)

    def _of_others(self, place: int) -> np.ndarray:
        """The same of all pairs of other takes."""
        return self._against_itself(value for pair, value in self.squares.items() if place not in pair)

    def _against_itself(self, squares: Iterable[np.ndarray]) -> np.ndarray:
        """In variances."""
        rows = [np.diagonal(each) / self.spread**2 for each in squares]
        return np.array(rows).reshape(-1, len(self.sensors))

    def _degrees(self, squares: np.ndarray | float) -> float:
        return self.spread_deg * float(np.sqrt(np.mean(squares)))

    def _sensors(self, limits: ComparisonLimits) -> Iterator[tuple[float, Unlike]]:
        """How much exchanging leaves, and the take, for each that it makes fit."""
        for place in range(len(self.parts)):
            others = [value for (one, _), value in self.squares.items() if one == place]
            usual = self._of_others(place)
            if not others or not len(usual):
                continue
            share = limits.exchanged_share * (1.0 if len(others) >= FEWEST_OTHERS else ONE_IS_ENOUGH)
            for a, b in combinations(range(len(self.sensors)), 2):
                own = np.array([each[a, a] + each[b, b] for each in others])
                exchanged = np.array([each[a, b] + each[b, a] for each in others])
                left = exchanged / np.maximum(own, 1e-12)
                whole = float(np.sum(self.spread[[a, b]] ** 2))
                pair = usual[:, [a, b]] @ self.spread[[a, b]] ** 2
                least = limits.exchanged_times * float(np.median(pair))
                off, fitted = float(np.median(own)), float(np.median(exchanged))
                if (
                    np.median(left) <= share
                    and (left < 1.0).all()
                    and fitted <= least <= off
                    and self._fit_without((a, b), place, limits)
                ):
                    degrees = [self._degrees(each / whole) for each in (off, float(pair.max()), fitted)]
                    names = self.sensors[a], self.sensors[b]
                    yield float(np.median(left)), Unlike(place, "sensors", names, *degrees)

    def _fit_without(self, pair: tuple[int, int], place: int, limits: ComparisonLimits) -> bool:
        """Whether the sensors of a take but two read what they do in the others."""
        own = np.delete(np.median(self._own(place), axis=0), pair)
        usual = np.delete(np.median(self._of_others(place), axis=0), pair)
        return not len(own) or float(own.mean()) <= limits.exchanged_times * float(usual.mean())

    def _rotations(self, limits: ComparisonLimits) -> Iterator[tuple[float, Unlike]]:
        """The same of reference columns, which no other take wants exchanged as well."""
        count = range(len(self.parts))
        for place in count if len(self.rotations) <= MOST_EXCHANGED else ():
            usual = self._of_others(place)
            if not len(usual):
                continue
            typical, most = float(np.median(usual, axis=0).mean()), float(usual.max(axis=0).mean())
            for a, b in combinations(range(len(self.rotations)), 2):
                order = list(range(len(self.rotations)))
                order[a], order[b] = b, a
                off, left = self._reordered(place, order)
                if left is None or off < limits.exchanged_least * typical:
                    continue
                if left > limits.exchanged_share * off or left > (most if np.isfinite(off) else typical):
                    continue
                theirs = [self._reordered(other, order, place) for other in count if other != place]
                if not any(
                    fits is not None and fits <= limits.exchanged_share * own
                    for own, fits in theirs
                    if np.isfinite(own)
                ):
                    names = self.rotations[a], self.rotations[b]
                    known = off if np.isfinite(off) else 1.0
                    degrees = [self._degrees(each) for each in (known, most, left)]
                    yield left / off, Unlike(place, "rotations", names, *degrees)

    def _reordered(
        self, place: int, order: Sequence[int], without: int | None = None
    ) -> tuple[float, float | None]:
        """Squared difference from the others as the take is, infinite where no posture is alike, and in
        another order of its rotations, None where too few takes have such postures."""
        others = [each for each in range(len(self.parts)) if each not in (place, without)]
        own = self._against_itself(
            self.squares[place, each] for each in others if (place, each) in self.squares
        )
        tried = [self._squares(place, each, order) for each in others]
        fitted = self._against_itself(each for each in tried if each is not None)
        return (
            float(np.median(own, axis=0).mean()) if len(own) else np.inf,
            float(np.median(fitted, axis=0).mean())
            if len(fitted) >= min(FEWEST_OTHERS, len(others))
            else None,
        )

    def _levels(self, limits: ComparisonLimits) -> Iterator[tuple[float, Unlike]]:
        """Takes of which most sensors read something else than in all others."""
        for place in range(len(self.parts)):
            theirs = [self._off(other, place) for other in range(len(self.parts)) if other != place]
            known = [each for each in theirs if each is not None]
            off = self._off(place)
            if off is None or len(known) < FEWEST_OTHERS:
                continue
            most = max(known)
            if off >= max(limits.other_level_least, limits.other_level_times * most):
                degrees = self.spread_deg * off
                yield most / off, Unlike(place, "level", (), degrees, self.spread_deg * most, degrees)

    def _off(self, place: int, without: int | None = None) -> float | None:
        """How far most sensors of a take are from the others, in standard deviations; None: no postures."""
        own = [value for (one, other), value in self.squares.items() if one == place and other != without]
        return float(np.sqrt(np.median(np.median(self._against_itself(own), axis=0)))) if own else None


def _some(take: Take, sensors: Sequence[str], rotations: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    angles = take.reference_at_frames(rotations)
    rows = np.flatnonzero(np.isfinite(angles).all(axis=1)) if rotations else np.empty(0, int)
    rows = rows[np.linspace(0, len(rows) - 1, min(MOST_POSTURES, len(rows))).astype(int)]
    return take.readings[rows][:, [take.sensors.index(name) for name in sensors]], angles[rows]


@dataclass(frozen=True)
class Wandering:
    """A take whose reference wanders."""

    place: int
    rotation: str
    by_deg: float
    """From its lowest to its highest."""
    off_deg: float
    """What the map leaves of the take, RMS; ``fitted_deg`` without the wandering."""
    usual_deg: float
    """What it leaves of all takes then."""
    fitted_deg: float


def wandering_references(
    takes: Sequence[Take], usable: Sequence[str], layout: Layout, limits: ComparisonLimits
) -> list[Wandering]:
    """The clearest one, or none, by ``usable`` sensors."""
    read = {name: layout.correspondence(name).sensors for name in layout.rotations}
    if len(takes) < FEWEST_TAKES or len(usable) < TIMES_AS_MANY * len(layout.rotations):
        return []
    odd_ones = []
    for rotation in layout.rotations:
        sensors = [name for name in read[rotation] if name in usable]
        if len(sensors) > 1:
            odd_ones += _of_rotation(takes, rotation, sensors, limits)
    return [min(odd_ones, key=lambda item: item.fitted_deg / item.off_deg)] if odd_ones else []


def _of_rotation(
    takes: Sequence[Take], rotation: str, sensors: Sequence[str], limits: ComparisonLimits
) -> list[Wandering]:
    places, parts = [], []
    for place, take in enumerate(takes):
        rows = _rows(take, rotation, sensors)
        if rows is not None:
            places.append(place)
            parts.append(rows)
    if len(places) < FEWEST_TAKES:
        return []
    of = np.repeat(np.arange(len(parts)), [len(part[0]) for part in parts])
    time, x, angle = (np.concatenate(column) for column in zip(*parts, strict=True))
    columns = np.column_stack([_shapes(x), *((of == each).astype(float) for each in range(len(parts)))])
    square = columns.T @ columns + SLOW_RIDGE * len(columns) * np.eye(columns.shape[1])

    def left(values: np.ndarray) -> np.ndarray:
        return values - columns @ np.linalg.solve(square, columns.T @ values)

    before, slow = left(angle), []
    for number in range(len(parts)):
        mine = of == number
        shape = np.where(mine[:, None], np.column_stack([time, time**2]), 0.0)
        rest = left(shape)
        weight = np.linalg.lstsq(rest, before, rcond=None)[0]
        after = before - rest @ weight
        slow.append((float(np.ptp(shape[mine] @ weight)), _rms(before[mine]), _rms(after[mine]), _rms(after)))
    odd_ones = []
    for number, (by, off, fitted, all_of) in enumerate(slow):
        others = max(each[0] for place, each in enumerate(slow) if place != number)
        if (
            by >= max(limits.wandering_deg, limits.wandering_times * others)
            and fitted <= limits.wandering_share * off
        ):
            odd_ones.append(Wandering(places[number], rotation, by, off, all_of, fitted))
    return odd_ones


def _rows(
    take: Take, rotation: str, sensors: Sequence[str]
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Times from -1 to 1, readings and angles; None where too few were measured."""
    if rotation not in take.rotations:
        return None
    angle = take.reference_at_frames([rotation])[:, 0]
    rows = np.flatnonzero(np.isfinite(angle))
    if len(rows) < FEWEST_SLOW_ROWS or take.time_s[rows[-1]] - take.time_s[rows[0]] < SHORTEST_SLOW_S:
        return None
    rows = rows[np.linspace(0, len(rows) - 1, min(MOST_SLOW_ROWS, len(rows))).astype(int)]
    time = take.time_s[rows]
    readings = take.readings[rows][:, [take.sensors.index(name) for name in sensors]]
    return 2 * (time - time[0]) / (time[-1] - time[0]) - 1, readings, angle[rows]


def _shapes(readings: np.ndarray) -> np.ndarray:
    """(N, C) of readings (N, S): themselves, and of few sensors squares and products."""
    x = (readings - readings.mean(axis=0)) / np.maximum(readings.std(axis=0), 1e-9)
    if x.shape[1] > MOST_WITH_PRODUCTS:
        return x
    pairs = combinations_with_replacement(range(x.shape[1]), 2)
    return np.column_stack([x, *(x[:, one] * x[:, other] for one, other in pairs)])


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
