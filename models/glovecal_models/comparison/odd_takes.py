"""Takes held against each other, before any effect is named: which one does not fit, and what would make it.

Every take gives sums of products of its readings and angles around its own means, so that an offset between
takes or wearings says nothing. A straight line through the takes without one tells how far that one is from
the others; the take without which the others agree best is odd, if they agree far better without it than with
it. Then it is tried whether a change of its columns, signs, gains or clock makes it fit.

Tuned on flex gloves with five sensors and simulated sessions with every known cause, of which no take may be
odd; tests/models/comparison/test_odd_takes.py has others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from glovecal_models.comparison.like_postures import (
    FEWEST_TAKES,
    OTHER_LEVEL,
    How,
    OddTake,
    Unlike,
    unlike_takes,
    wandering_references,
)
from glovecal_models.comparison.limits import COMPARISON_LIMITS, ComparisonLimits
from glovecal_models.layout import Layout
from glovecal_models.takes.channel_faults import session_faults
from glovecal_models.takes.clock_scan import (
    LOOKS_LIKE_LAG_S,
    aligned,
    clock_offsets,
    on_grid,
    unexplained,
    without_reference,
)
from glovecal_models.takes.take import Take

FEWEST_TELLING_ROWS = 60
MOST_COMPARED_ROWS = 1500
"""Of a longer take every second, third ... row."""
LEAST_ROTATION_SD_DEG = 3.0
"""A rotation that moved less in a take tells nothing of it."""
MOST_SUSPECTS = 5
RIDGE = 1e-3
KEPT = 0.9
"""An assignment must save so much more than a column's own place; cycles that do not are put back."""

Item = TypeVar("Item")
UNEXPLAINED = 0.1
"""Share of the reference's variance: where readings leave more of most takes, their clocks are looked at."""


def odd_takes(
    takes: Sequence[Take], layout: Layout, limits: ComparisonLimits = COMPARISON_LIMITS
) -> tuple[OddTake, ...]:
    """The worst first; none among fewer than three takes, and never half of them or more."""
    if not all(set(layout.sensors) <= set(take.sensors) for take in takes):
        return ()  # whoever works with them says which sensor is missing
    first = _in_like_postures(takes, layout, limits)
    if first:
        return tuple(first)
    sums = [_Sums.of(take, layout) for take in takes]
    told = [number for number, each in enumerate(sums) if each.is_told]
    most = (len(told) - 1) // 2
    left, out = list(told), list[int]()
    found: list[OddTake] = []
    while not found and len(out) < most and len(left) >= FEWEST_TAKES:
        suspect = _suspect([sums[number] for number in left], limits)
        if suspect is None:
            break
        out.append(left.pop(suspect))
        rest = [sums[number] for number in left]
        line, usual = _Line.through(rest), max(_errors(rest))
        if all(_is_odd(sums[number], line, usual, limits) for number in out):
            found = [_explained(number, takes[number], sums[number], line, usual, limits) for number in out]
    left = left if found else told
    while len(left) >= FEWEST_TAKES and len(found) < most:
        far = _farthest([takes[number] for number in left], [sums[number] for number in left], limits)
        if far is None:
            break
        place, odd_level = far
        found.append(replace(odd_level, place=left.pop(place)))
    return tuple(found)


def _in_like_postures(takes: Sequence[Take], layout: Layout, limits: ComparisonLimits) -> list[OddTake]:
    """Those that other takes of their wearing contradict, and one whose reference wanders."""
    faulty = {name for _, fault in session_faults(takes, layout.sensors) for name in fault.channels}
    sensors, takes = [name for name in layout.sensors if name not in faulty], _on_one_clock(takes)
    odd = [_unlike(item, takes[item.place]) for item in unlike_takes(takes, sensors, layout, limits)]
    places = [place for place in range(len(takes)) if place not in {item.place for item in odd}]
    for item in wandering_references([takes[place] for place in places], sensors, layout, limits):
        place = places[item.place]
        change = (
            f"the reference of {item.rotation} wanders by {item.by_deg:.0f} degrees in the course of the take"
            " while the sensors do not. Did a marker slip? Record it again."
        )
        odd.append(
            OddTake(
                place, takes[place].name, item.off_deg, item.usual_deg, "wandering", item.fitted_deg, change
            )
        )
    return odd


def _unlike(item: Unlike, take: Take) -> OddTake:
    what = {"sensors": "sensor columns", "rotations": "reference columns"}.get(item.how)
    change = OTHER_LEVEL if what is None else f"Its {what} {' and '.join(item.names)} are exchanged"
    return OddTake(
        item.place, take.name, item.off_deg, item.usual_deg, item.how, item.fitted_deg, change, True
    )


def _on_one_clock(takes: Sequence[Take]) -> Sequence[Take]:
    """With each reference on its frames' clock, where the readings tell that most are not."""
    grids = [grid for take in takes if (grid := on_grid(_bridged(take))) is not None]
    left = [unexplained(grid, grid.readings, grid.time_s) for grid in grids]
    if not left or not np.nanmedian(left) > UNEXPLAINED:
        return takes
    return [
        without_reference(take) if odd.is_unknown else aligned(take, odd.offset_s)
        for take, odd in zip(takes, clock_offsets([_bridged(take) for take in takes]), strict=True)
    ]


def _bridged(take: Take) -> Take:
    """With angles between those that were left out, as clocks need whole columns; nobody states a deviation
    of these."""
    reference = take.reference.copy()
    for column in reference.T:
        known = np.isfinite(column)
        if known.any():
            column[~known] = np.interp(
                take.reference_time_s[~known], take.reference_time_s[known], column[known]
            )
    return replace(take, reference=reference, reference_sd=None)


def fitting(items: Sequence[Item], odd: Sequence[OddTake]) -> list[Item]:
    """Of ``items``, one for each take, those of takes that are not set aside."""
    places = {item.place for item in odd if item.is_set_aside}
    return [item for place, item in enumerate(items) if place not in places]


@dataclass(frozen=True)
class _Sums:
    """Of one take, for each of R rotations and S sensors, around the take's means."""

    layout: Layout
    time_s: np.ndarray
    """(N,)."""
    readings: np.ndarray
    """(N, S)."""
    angles: np.ndarray
    """(N, R), NaN where not measured."""

    @classmethod
    def of(cls, take: Take, layout: Layout) -> _Sums:
        order = [take.sensors.index(name) for name in layout.sensors]
        some = slice(None, None, 1 + len(take.time_s) // MOST_COMPARED_ROWS)
        angles = take.reference_at_frames(layout.rotations)
        return cls(layout, take.time_s[some], take.readings[some][:, order], angles[some])

    @cached_property
    def told(self) -> np.ndarray:
        """(R,) whether the take tells of a rotation."""
        known = np.isfinite(self.angles)
        enough = known.sum(axis=0) >= FEWEST_TELLING_ROWS
        spread = np.array([part[mask].std() if mask.any() else 0.0 for part, mask in
                           zip(self.angles.T, known.T, strict=True)])  # fmt: skip
        return enough & (spread >= LEAST_ROTATION_SD_DEG)

    @property
    def is_told(self) -> bool:
        return bool(self.told.any())

    @cached_property
    def products(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(R, S, S) readings by readings, (R, S) readings by angle, (R,) variance: means over rows."""
        rotations, sensors = self.angles.shape[1], self.readings.shape[1]
        square, cross = np.zeros((rotations, sensors, sensors)), np.zeros((rotations, sensors))
        variance, cache = np.zeros(rotations), {}
        for place in np.flatnonzero(self.told):
            known = np.isfinite(self.angles[:, place])
            key = known.tobytes()
            if key not in cache:
                x = self.readings[known] - self.readings[known].mean(axis=0)
                cache[key] = x, x.T @ x / len(x)
            x, square[place] = cache[key]
            y = self.angles[known, place] - self.angles[known, place].mean()
            cross[place], variance[place] = x.T @ y / len(y), float(y @ y) / len(y)
        return square, cross, variance

    def error(self, line: _Line) -> float:
        """Degrees RMS over the rotations that both tell."""
        square, cross, variance = self.products
        told = self.told & line.told
        if not told.any():
            return 0.0
        weight = line.weight[told]
        left = variance[told] - 2 * (weight * cross[told]).sum(axis=1)
        left += np.einsum("rs,rst,rt->r", weight, square[told], weight)
        return float(np.sqrt(np.maximum(left, 0.0).mean()))

    def spread(self, line: _Line) -> float:
        told = self.told & line.told
        return float(np.sqrt(self.products[2][told].mean())) if told.any() else 0.0


@dataclass(frozen=True)
class _Line:
    weight: np.ndarray
    """(R, S) degrees for each raw unit."""
    told: np.ndarray
    """(R,)."""

    @classmethod
    def through(cls, takes: Sequence[_Sums], without: Sequence[int] = ()) -> _Line:
        """``without``: places of takes that it does not go through."""
        layout, chosen = takes[0].layout, [each for i, each in enumerate(takes) if i not in without]
        square = np.sum([each.products[0] for each in chosen], axis=0)
        cross = np.sum([each.products[1] for each in chosen], axis=0)
        told = np.any([each.told for each in chosen], axis=0)
        weight = np.zeros_like(cross)
        for place, rotation in enumerate(layout.rotations):
            read = layout.correspondence(rotation).sensors
            index = [layout.sensors.index(name) for name in read]
            scale = np.sqrt(np.maximum(np.diagonal(square[place])[index], 0.0))
            alive = scale > 0
            index, scale = [i for i, lives in zip(index, alive, strict=True) if lives], scale[alive]
            if told[place] and index:
                normal = square[place][np.ix_(index, index)] / np.outer(scale, scale)
                normal += RIDGE * np.eye(len(index))
                weight[place, index] = np.linalg.solve(normal, cross[place, index] / scale) / scale
        return cls(weight, told)


def _suspect(sums: Sequence[_Sums], limits: ComparisonLimits) -> int | None:
    """Place of the take without which the others agree best; None where all agree."""
    errors = _errors(sums)
    if max(errors) < limits.odd_least_deg:
        return None
    # It is among those that are farthest off: the others are only as far off as it pulls the line.
    suspects = np.argsort(errors)[::-1][:MOST_SUSPECTS]
    return int(min(suspects, key=lambda place: float(np.square(_errors(sums, int(place))).sum())))


def _errors(sums: Sequence[_Sums], without: int | None = None) -> list[float]:
    """Of each take but one, against the line through the rest of them."""
    gone = [] if without is None else [without]
    return [
        each.error(_Line.through(sums, [*gone, place])) for place, each in enumerate(sums) if place != without
    ]


def _is_odd(take: _Sums, line: _Line, usual: float, limits: ComparisonLimits) -> bool:
    error = take.error(line)
    return error >= max(
        limits.odd_least_deg, limits.odd_times * max(usual, 1.0), limits.odd_share * take.spread(line)
    )


def _farthest(
    takes: Sequence[Take], sums: Sequence[_Sums], limits: ComparisonLimits
) -> tuple[int, OddTake] | None:
    """Place of the take whose readings lie elsewhere at the same angles, far beyond the others'."""
    lines = [_Line.through(sums, [place]) for place in range(len(sums))]
    levels = [_levels(sums, line) for line in lines]
    off = [_off(each, place) for place, each in enumerate(levels)]
    best = int(np.argmax(off))
    others = max(_off(np.delete(levels[best], best, axis=0), other) for other in range(len(sums) - 1))
    worn_alike = [take.wearing for take in takes].count(takes[best].wearing) > 1
    least = limits.odd_level_deg if worn_alike else limits.odd_level_other_wearing_deg
    if off[best] < max(least, limits.odd_level_times * others):
        return None
    if sums[best].error(lines[best]) > limits.odd_level_told_share * sums[best].spread(lines[best]):
        return None  # a line that does not follow the angles tells no level
    error = sums[best].error(lines[best])
    return best, OddTake(best, takes[best].name, off[best], others, "level", error, OTHER_LEVEL)


def _levels(sums: Sequence[_Sums], line: _Line) -> np.ndarray:
    """(takes, R) mean angle less what the line makes of the mean readings; NaN where not told."""
    result = np.full((len(sums), len(line.told)), np.nan)
    for row, each in enumerate(sums):
        for place in np.flatnonzero(each.told & line.told):
            known = np.isfinite(each.angles[:, place])
            shown = each.readings[known].mean(axis=0) @ line.weight[place]
            result[row, place] = each.angles[known, place].mean() - shown
    return result


def _off(levels: np.ndarray, place: int) -> float:
    """Degrees RMS between the levels of a take and the median of the others."""
    others = np.delete(levels, place, axis=0)
    told = np.isfinite(levels[place]) & np.isfinite(others).any(axis=0)
    if not told.any():
        return 0.0
    away = levels[place, told] - np.nanmedian(others[:, told], axis=0)
    return float(np.sqrt(np.mean(away**2)))


def _explained(
    place: int, take: Take, sums: _Sums, line: _Line, usual: float, limits: ComparisonLimits
) -> OddTake:
    """The simplest change that makes the take fit."""
    error = sums.error(line)
    least = limits.odd_fitted_times * max(usual, 1.0)
    fits: list[tuple[How, float, str]] = [
        item
        for item in _changes(take, sums, line, limits)
        if item[1] <= least and item[1] < limits.odd_alike_share * error
    ]
    if not fits:
        return OddTake(place, take.name, error, usual, "nothing", error, "")
    best = min(left for _, left, _ in fits)
    how, left, change = next(
        item for item in fits if limits.odd_alike_share * item[1] <= max(best, 0.5 * least)
    )
    columns = [item for item in fits if item[0] in ("sensors", "rotations")]
    if how == "sensors" and len(columns) == 2 and columns[1][1] * limits.odd_alike_share < left:
        return OddTake(
            place, take.name, error, usual, "columns", left, f"{change}, or {_lower(columns[1][2])}"
        )
    return OddTake(place, take.name, error, usual, how, left, change)


def _lower(text: str) -> str:
    return text[0].lower() + text[1:]


def _changes(
    take: Take, sums: _Sums, line: _Line, limits: ComparisonLimits
) -> Iterator[tuple[How, float, str]]:
    """How, the error that is left, and a sentence's beginning: the simplest first."""
    yield _of_clock(take, sums, line)
    yield _turned(sums, line, limits)
    yield _other_sensors(sums, line)
    yield _other_rotations(sums, line)
    yield _other_gains(sums, line)
    own = sums.error(_Line.through([sums]))
    yield (
        "own map", own,
        "A line of its own fits it (another person's hand, or another glove?)",
    )  # fmt: skip


def _of_clock(take: Take, sums: _Sums, line: _Line) -> tuple[How, float, str]:
    """Its clocks agree once its reference is moved, as ``take clocks`` would.

    Where the others' clocks are off, too, the line through them tells nothing; a line of its own does.
    """
    [found] = clock_offsets([take])
    if found.verdict != "offset":
        return "shift", np.inf, ""
    changed = _Sums.of(aligned(take, found.offset_s), sums.layout)
    error = changed.error(line)
    if abs(found.offset_s) > abs(LOOKS_LIKE_LAG_S):
        error = min(error, changed.error(_Line.through([changed])))
    word = "later" if found.offset_s > 0 else "earlier"
    return (
        "shift", error,
        f"Its reference is {abs(found.offset_s):.2f} s {word} than its readings; moved by that it fits:"
        " glovecal take clocks finds and repairs it",
    )  # fmt: skip


def _turned(sums: _Sums, line: _Line, limits: ComparisonLimits) -> tuple[How, float, str]:
    """Rotations of the other sign."""
    angles, names = sums.angles.copy(), []
    square, cross, variance = sums.products
    for place in map(int, np.flatnonzero(sums.told & line.told)):
        along = float(line.weight[place] @ cross[place])
        left = variance[place] + float(line.weight[place] @ square[place] @ line.weight[place])
        if left + 2 * along < limits.odd_alike_share**2 * (left - 2 * along):
            angles[:, place] *= -1
            names.append(sums.layout.rotations[int(place)])
    if not names:
        return "signs", np.inf, ""
    what = (
        "all rotations (or of all readings)"
        if len(names) == int((sums.told & line.told).sum())
        else ", ".join(names)
    )
    abduction = all("ABD" in name for name in names)
    why = " (is it the other hand?)" if abduction and len(names) > 1 else ""
    changed = replace(sums, angles=angles)
    return "signs", changed.error(line), f"With the sign of {what} turned around it fits{why}"


def _other_sensors(sums: _Sums, line: _Line) -> tuple[How, float, str]:
    """Readings whose columns stand in another order."""

    def changed(order: np.ndarray) -> _Sums:
        return replace(sums, readings=sums.readings[:, order])

    read = np.flatnonzero((line.weight != 0).any(axis=0))
    order = _best_order(len(sums.layout.sensors), read, lambda order: changed(order).error(line))
    return _of_order("sensors", "sensor columns", sums.layout.sensors, order, changed, line)


def _other_rotations(sums: _Sums, line: _Line) -> tuple[How, float, str]:
    """Angles whose columns stand in another order."""

    def changed(order: np.ndarray) -> _Sums:
        return replace(sums, angles=sums.angles[:, order])

    told = np.flatnonzero(sums.told & line.told)
    order = _best_order(len(sums.layout.rotations), told, lambda order: changed(order).error(line))
    return _of_order("rotations", "reference columns", sums.layout.rotations, order, changed, line)


def _of_order(
    how: How,
    what: str,
    names: Sequence[str],
    order: np.ndarray,
    changed: Callable[[np.ndarray], _Sums],
    line: _Line,
) -> tuple[How, float, str]:
    moved = np.flatnonzero(order != np.arange(len(order)))
    if not len(moved):
        return how, np.inf, ""
    if len(moved) > 2 and (order[moved] == moved[::-1]).all():
        text = f"Its {what} {names[moved[0]]} to {names[moved[-1]]} stand in reverse order"
    elif len(moved) == 2:
        text = f"Its {what} {names[moved[0]]} and {names[moved[1]]} are exchanged"
    else:
        pairs = ", ".join(
            f"{names[now]} is {names[place]}" for place, now in enumerate(order.tolist()) if now != place
        )
        text = f"Its {what} stand in another order: {pairs}"
    return how, changed(order).error(line), text


def _best_order(count: int, some: np.ndarray, error: Callable[[np.ndarray], float]) -> np.ndarray:
    """The order of ``count`` columns with the smallest error: ``some`` of them reversed, rolled by one, or
    exchanged by twos as long as that helps."""
    starts = []
    for begin in range(len(some)):
        for end in range(begin + 2, len(some) + 1):
            part = some[begin:end]
            starts += [
                _moved(count, part, order) for order in (part[::-1], np.roll(part, 1), np.roll(part, -1))
            ]
    best = min([np.arange(count), *starts], key=error)
    least = error(best)
    while True:
        tries = [_moved_in(best, one, other) for place, one in enumerate(some) for other in some[place + 1 :]]
        order = min(tries, key=error, default=best)
        if error(order) >= KEPT * least:
            return _put_back(best, error)
        best, least = order, error(order)


def _moved(count: int, places: np.ndarray, to: np.ndarray) -> np.ndarray:
    order = np.arange(count)
    order[places] = to
    return order


def _moved_in(order: np.ndarray, one: int, other: int) -> np.ndarray:
    result = order.copy()
    result[[one, other]] = order[[other, one]]
    return result


def _put_back(order: np.ndarray, error: Callable[[np.ndarray], float]) -> np.ndarray:
    """Without exchanges that do not help."""
    best, least = order, error(order)
    for one in range(len(order)):
        if best[one] != one:
            other = int(np.flatnonzero(best == one)[0])
            tried = _moved_in(best, one, other)
            left = error(tried)
            if left <= least * 1.02:
                best, least = tried, left
    return best


def _other_gains(sums: _Sums, line: _Line) -> tuple[How, float, str]:
    """Sensors that answer more or less than in the other takes."""
    square, cross, _ = sums.products
    told = np.flatnonzero(sums.told & line.told)
    normal = sum(
        np.outer(line.weight[place], line.weight[place]) * square[place] for place in told
    ) + np.zeros((len(sums.layout.sensors),) * 2)
    right = sum(line.weight[place] * cross[place] for place in told) + np.zeros(len(sums.layout.sensors))
    size = np.trace(normal) / len(normal)
    gains = np.linalg.solve(normal + RIDGE * size * np.eye(len(normal)), right + RIDGE * size)
    changed = replace(sums, readings=sums.readings * gains)
    turned = [name for name, gain in zip(sums.layout.sensors, gains, strict=True) if gain < -0.2]
    sign = f"; {', '.join(turned)} runs the other way" if turned else ""
    low, high = float(np.abs(gains).min()), float(np.abs(gains).max())
    return (
        "gains", changed.error(line),
        f"With gains of its own for each sensor ({low:.1f} to {high:.1f} times the others'{sign}) it fits"
        " (another glove, or another person's hand?)",
    )  # fmt: skip
