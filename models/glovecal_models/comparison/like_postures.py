"""Takes of one wearing held against each other where their joints stand alike.

A line through takes with different motions says little of one that moves elsewhere. Where two takes go
through the same angles, their sensors read the same, whatever the map between them is: of a take whose
readings there are another take's only once two columns are exchanged, the columns are exchanged. Every other
take of the wearing has to say so. Nothing is asked of postures that no other take has.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Literal

import numpy as np

from glovecal_models.comparison.limits import ComparisonLimits
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

MOST_POSTURES = 120
"""Of a take, evenly."""
FEWEST_LIKE_ROWS = 8
"""Of a take that stand like rows of another."""
FEWEST_OTHERS = 2
ALIKE_ANGLE_DEG, ALIKE_ANGLE_SHARE = 3.0, 0.1
"""Angles alike, in degrees and of the standard deviation over all takes."""
MOST_HELD_ALIKE, MOST_EXCHANGED = 6, 3
"""Of more, hardly any two postures are alike in all; and some pair of rotations fits by chance."""
LEAST_MOVED_WITHIN_DEG = 3.0
"""Of a hand that moves less within takes, readings tell the hand's rest."""
ONE_IS_ENOUGH = 0.25
"""Times the share that exchanging may leave: then one other take is enough, which others agree with."""


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
    found = []
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
            found.append(Unlike(place, odd.how, odd.names, odd.off_deg, odd.usual_deg, odd.fitted_deg))
            most -= 1
    return found


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
            found = min(far, key=lambda item: item[0], default=None)
            if found is not None:
                return found[1]
        return None

    @cached_property
    def squares(self) -> dict[tuple[int, int], np.ndarray]:
        """(S, S) mean squared difference of each sensor of one take from each of another, by their places;
        without takes that have no postures alike."""
        count = range(len(self.parts))
        found = {(i, j): self._squares(i, j) for i in count for j in count if i != j}
        return {key: value for key, value in found.items() if value is not None}

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
                    names, told = (self.rotations[a], self.rotations[b]), off if np.isfinite(off) else 1.0
                    degrees = [self._degrees(each) for each in (told, most, left)]
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
