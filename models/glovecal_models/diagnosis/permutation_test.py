"""Permutation test of a cause that changes from take to take: the takes are the exchangeable units.

Blocks of one take share its context, so they are not independent: only the takes are. The context of each
take (or its wearing) is given to another one, and the same columns are fitted; base and rows stay.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil, factorial, prod

import numpy as np

from glovecal_models.comparison.residuals import partition_of, permuted_sessions
from glovecal_models.diagnosis.forward_design import ForwardDesign
from glovecal_models.diagnosis.limits import DiagnosisLimits
from glovecal_models.effects.base.control import motions_of, with_context
from glovecal_models.effects.base.dynamics import LONGEST_GAP_S
from glovecal_models.effects.base.effect import CorrectionEffect, Effect
from glovecal_models.effects.base.signals import Settings, Signals

PERMUTATIONS = 299
ROWS_PER_TAKE = 80


def session_p_value(design: ForwardDesign, effect: CorrectionEffect, generator: np.random.Generator) -> float:
    """Share of permutations that explain as much, over all joints together or on one.

    The smaller of the two shares is compared with the smaller of each permutation's own, which corrects for
    the choice between them.
    """
    joints = range(len(design.rotations))
    permutations = _permutations(design, effect, generator)
    rows = [_thinned(take.time_s) for take in design.signals]
    thin = [take.at(some) for take, some in zip(design.signals, rows, strict=True)]
    settings = design.constants(effect)
    left = [_projected(design, joint, rows) for joint in joints]
    given = _Given(effect, settings, effect.shape.grid(design.signals, settings), thin, left)
    own = _own_givers(thin, effect)
    every = np.array([given.explained(order) for order in (own, *permutations)])
    return share_as_large(every)


def share_as_large(explained: np.ndarray) -> float:
    """Of draws (D, J), the first of which is as it was recorded: those that explain as much of all joints
    together, or of one."""
    shares = np.minimum(_shares_as_large(explained.sum(axis=1)), _shares_as_large(explained.max(axis=1)))
    return float(np.mean(shares <= shares[0] * (1 + 1e-9)))


@dataclass(frozen=True)
class _Products:
    """Sums over the rows of one take, for each joint J and shape G."""

    columns: np.ndarray
    """(J, G, C, C), columns with columns."""
    base: np.ndarray
    """(J, G, P, C), with an orthonormal base."""
    target: np.ndarray
    """(J, G, C), with what the base leaves of the target."""


class _Given:
    """What columns explain when takes are given the context, or the wearing, of others.

    A permutation is a sum over its takes: what a take contributes with each giver is worked out once.
    """

    def __init__(
        self,
        effect: CorrectionEffect,
        settings: Settings,
        grid: np.ndarray,
        takes: Sequence[Signals],
        joints: Sequence[_Projected],
    ) -> None:
        self._effect, self._settings, self._grid = effect, settings, grid
        self._takes = takes
        self._parts = [_TakePart.of(joints, take) for take in range(len(takes))]
        self._square = np.array([float(joint.target @ joint.target) for joint in joints])
        count = np.array([len(joint.target) for joint in joints])
        self._held = (self._square / count)[:, None] / effect.weights(settings).prior_sd ** 2 * 4.0
        self._kept: dict[tuple[int, int], _Products] = {}

    def explained(self, givers: np.ndarray) -> np.ndarray:
        """(J,) share of the target's square that columns explain beside the base, weights shrunk by their
        prior; ``givers``: for each take a number as ``_permutations`` has them."""
        parts = [self._of(take, int(giver)) for take, giver in enumerate(givers)]
        base = _sum([part.base for part in parts])
        gram = _sum([part.columns for part in parts]) - base.swapaxes(-1, -2) @ base
        right = _sum([part.target for part in parts])
        gram = gram + self._held[:, None, :, None] * np.eye(gram.shape[-1])
        moves = self._square > 0
        found = np.zeros(len(self._square))
        beta = np.linalg.solve(gram[moves], right[moves][..., None])[..., 0]
        shares = np.einsum("jgc,jgc->jg", right[moves], beta) / self._square[moves, None]
        found[moves] = shares.max(axis=1)
        return found

    def _of(self, take: int, giver: int) -> _Products:
        if (take, giver) not in self._kept:
            self._kept[take, giver] = self._products(take, _given(self._takes, take, giver, self._effect))
        return self._kept[take, giver]

    def _products(self, number: int, take: Signals) -> _Products:
        found = [self._effect.columns(take, self._settings, shape) for shape in self._grid]
        every = np.stack(found, axis=1)
        part, (_, shapes, lanes, added) = self._parts[number], every.shape
        # All joints at once: (J, M, G, C).
        mine = np.where(part.is_measured[..., None, None], every[part.row, :, np.arange(lanes)[:, None]], 0.0)
        beside = part.beside @ mine.reshape(lanes, -1, shapes * added)
        beside = np.moveaxis(beside.reshape(lanes, -1, shapes, added), 1, 2)
        base, target = np.ascontiguousarray(beside[:, :, :-1]), beside[:, :, -1].copy()
        columns = mine.transpose(0, 2, 3, 1) @ mine.transpose(0, 2, 1, 3)
        return _Products(columns, base, target)


def _sum(parts: Sequence[np.ndarray]) -> np.ndarray:
    """Of arrays of one shape, which are not copied side by side first."""
    total = parts[0].copy()
    for part in parts[1:]:
        total += part
    return total


def _shares_as_large(values: np.ndarray) -> np.ndarray:
    """For each of (D,): the share of all that are as large."""
    return np.mean(values[None, :] >= values[:, None] * (1 - 1e-9), axis=1)


def wearing_permutations(takes: Sequence[Signals], generator: np.random.Generator) -> list[np.ndarray]:
    """Other assignments of takes to wearings, among takes of the same motion where names tell motions."""
    names = [take.wearing for take in takes]
    order = list(dict.fromkeys(names))
    owners = np.array([order.index(name) for name in names])
    groups = _motion_groups(owners, motions_of(takes))
    if groups:
        return _within_motions(owners, groups, generator)
    return permuted_sessions(owners, PERMUTATIONS, generator)


def _permutations(
    design: ForwardDesign, effect: CorrectionEffect, generator: np.random.Generator
) -> list[np.ndarray]:
    if effect.comparison.control == "permuted wearings":
        return wearing_permutations(design.signals, generator)
    return [generator.permutation(len(design.signals)) for _ in range(PERMUTATIONS)]


def _motion_groups(owners: np.ndarray, motions: Sequence[str]) -> list[np.ndarray]:
    """Takes of one motion each that was done in several wearings; none when names tell few such motions."""
    groups = [np.flatnonzero([m == motion for m in motions]) for motion in dict.fromkeys(motions)]
    permuted = [group for group in groups if len(set(owners[group].tolist())) > 1]
    if len(groups) < 2 or 2 * sum(map(len, permuted)) < len(owners):
        return []
    return permuted


def _within_motions(
    owners: np.ndarray, groups: Sequence[np.ndarray], generator: np.random.Generator
) -> list[np.ndarray]:
    """Distinct permutations that move takes only within their group."""
    found: dict[tuple[int, ...], np.ndarray] = {}
    for _ in range(20 * PERMUTATIONS):
        permuted = owners.copy()
        for group in groups:
            permuted[group] = owners[generator.permutation(group)]
        found[partition_of(permuted)] = permuted
    found.pop(partition_of(owners), None)
    return list(found.values())[:PERMUTATIONS]


def _own_givers(takes: Sequence[Signals], effect: CorrectionEffect) -> np.ndarray:
    """Every take as it was recorded."""
    if effect.comparison.control != "permuted wearings":
        return np.arange(len(takes))
    names = list(dict.fromkeys(take.wearing for take in takes))
    return np.array([names.index(take.wearing) for take in takes])


def _given(takes: Sequence[Signals], take: int, giver: int, effect: CorrectionEffect) -> Signals:
    """A take with the wearing of that number, or the context of the take of that number."""
    if effect.comparison.control == "permuted wearings":
        names = list(dict.fromkeys(each.wearing for each in takes))
        return replace(takes[take], wearing=names[giver])
    return takes[take] if take == giver else with_context(takes[take], takes[giver])


def _thinned(time_s: np.ndarray) -> np.ndarray:
    """Rows of a take: few, but close enough that nothing that remembers takes them for a gap."""
    length = len(time_s)
    wanted = max(ROWS_PER_TAKE, round(2.0 * float(time_s[-1] - time_s[0]) / LONGEST_GAP_S)) if length else 0
    return np.unique(np.linspace(0, length - 1, min(wanted, length)).astype(int))


@dataclass(frozen=True)
class _Projected:
    """The thinned rows of one joint that were measured."""

    base: np.ndarray
    """(N, P), orthonormal."""
    target: np.ndarray
    """(N,), degrees: what the base leaves of it."""
    take: np.ndarray
    """(N,), number of the take."""
    row: np.ndarray
    """(N,), among the take's thinned rows."""

    def rows_of(self, take: int) -> tuple[np.ndarray, np.ndarray]:
        """Of a take: which of its thinned rows, and where they stand here."""
        part = np.flatnonzero(self.take == take)
        return self.row[part], part


@dataclass(frozen=True)
class _TakePart:
    """One take's thinned rows of all joints side by side, filled up where a joint has fewer."""

    row: np.ndarray
    """(J, M), among the take's thinned rows."""
    is_measured: np.ndarray
    """(J, M), False where filled up."""
    beside: np.ndarray
    """(J, P + 1, M): the bases, with zeros up to the largest, and the targets; 0 where filled up."""

    @classmethod
    def of(cls, joints: Sequence[_Projected], take: int) -> _TakePart:
        size, parts = max(joint.base.shape[1] for joint in joints), [joint.rows_of(take) for joint in joints]
        most = max(len(row) for row, _ in parts)
        rows, beside = np.zeros((len(joints), most), dtype=int), np.zeros((len(joints), size + 1, most))
        is_measured = np.zeros(rows.shape, dtype=bool)
        for lane, (joint, (row, part)) in enumerate(zip(joints, parts, strict=True)):
            rows[lane, : len(row)], is_measured[lane, : len(row)] = row, True
            beside[lane, : joint.base.shape[1], : len(row)] = joint.base[part].T
            beside[lane, -1, : len(row)] = joint.target[part]
        return cls(rows, is_measured, beside)


def _projected(design: ForwardDesign, joint: int, rows: Sequence[np.ndarray]) -> _Projected:
    base, target, owner, row = [], [], [], []
    for unit, (take, fitted) in zip(design.products[joint].units, design.units(joint), strict=True):
        if not len(fitted):
            continue
        some = rows[take]
        at = np.clip(np.searchsorted(fitted, some), 0, len(fitted) - 1)
        near = np.abs(fitted[at] - some) <= 2
        base.append(unit.base[at[near]])
        target.append(unit.target[at[near]])
        row.append(np.flatnonzero(near))
        owner.append(np.full(len(row[-1]), take))
    orthogonal, _ = np.linalg.qr(np.concatenate(base))
    values = np.concatenate(target)
    left = values - orthogonal @ (orthogonal.T @ values)
    return _Projected(orthogonal, left, np.concatenate(owner), np.concatenate(row))


MOST_WEARINGS = 4
"""That are asked for at once."""


@dataclass(frozen=True)
class Wearings:
    """Assignments of takes to wearings, which a permutation test of wearings draws from."""

    names: tuple[str, ...]
    """Of the wearings there are."""
    ways: int
    """Different ones, the recorded one included."""
    needed: int
    further: int
    """Wearings that are missing."""
    take_names: tuple[str, ...]
    """Of the takes of each."""


def wearings_for(takes: Sequence[Signals], effect: Effect, limits: DiagnosisLimits) -> Wearings:
    """How many the takes have, and how many an effect needs whose control is permuted wearings."""
    assert effect.comparison is not None
    needed = ceil(1 / effect.comparison.certainty.clear)
    names = [take.wearing for take in takes]
    largest = max(names, key=names.count)
    each = max(limits.fewest_takes_of_a_wearing, names.count(largest))
    repeated = ([take for take in takes if take.wearing == largest] * each)[:each]
    take_names = tuple(
        motion.replace(" ", "-") or f"take{number}" for number, motion in enumerate(motions_of(repeated), 1)
    )
    ways, further, every = _ways(takes), 0, list(takes)
    while further < MOST_WEARINGS and (ways if not further else _ways(every)) < needed:
        further += 1
        every += [
            replace(take, wearing=f"further {further}", take=name)
            for take, name in zip(repeated, take_names, strict=True)
        ]
    return Wearings(tuple(dict.fromkeys(names)), ways, needed, further, take_names)


def _ways(takes: Sequence[Signals]) -> int:
    if len({take.wearing for take in takes}) < 2:
        return 1
    return 1 + len(wearing_permutations(takes, np.random.default_rng(0)))


@dataclass(frozen=True)
class Levels:
    """Values of a context column over takes, which a permutation test of that column draws from."""

    column: str
    takes: int
    values: int
    ways: int
    """Different assignments of values to takes, the recorded one included."""
    needed: int
    further: int
    """Takes at values of their own that are missing."""


def levels_for(takes: Sequence[Signals], effect: Effect, limits: DiagnosisLimits) -> Levels | None:
    """How many the takes have, of the column of an effect that varies most, and how many it needs; None where
    a column was not recorded."""
    assert effect.comparison is not None
    if not all(any(_is_known(take, name) for take in takes) for name in effect.context):
        return None
    alike = limits.alike_context_share
    column = max(effect.context, key=lambda name: _arrangements(_takes_at_levels(takes, name, alike)))
    levels = _takes_at_levels(takes, column, alike)
    certainty, count = effect.comparison.certainty, sum(levels)
    least = min(certainty.clear, certainty.of_few_takes) if count < limits.few_takes else certainty.clear
    ways, needed, further = _arrangements(levels), ceil(1 / least), 0
    while _arrangements([*levels, *([1] * further)]) < needed:
        further += 1
    return Levels(column, count, len(levels), ways, needed, further)


def _takes_at_levels(takes: Sequence[Signals], column: str, equal: float) -> list[int]:
    """How many takes share a mean of the column, for each value of it; ``equal``: share of its range."""
    means = [float(np.nanmean(take.context[column])) for take in takes if _is_known(take, column)]
    every = np.concatenate([take.context[column] for take in takes if _is_known(take, column)])
    width = max(equal * float(np.nanmax(every) - np.nanmin(every)), 1e-12)
    steps = np.cumsum(np.append(0, np.diff(np.sort(means)) > width))
    return np.bincount(steps).tolist()


def _is_known(take: Signals, column: str) -> bool:
    return column in take.context and bool(np.isfinite(take.context[column]).any())


def _arrangements(levels: Sequence[int]) -> int:
    return factorial(sum(levels)) // prod(factorial(count) for count in levels)
