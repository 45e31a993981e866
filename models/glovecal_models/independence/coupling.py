"""Coupling decomposition: the shares of all affecting sensors in a still sensor's signal.

Sensors are taken in one after another while the error on pieces of time left out falls, then products of
two; what is no longer missed is dropped again. The share of a sensor is what its own curve does on an even
sweep over the range it was moved through: standard and largest deviation, as in Wang & Neff 2013, Table 1.
Intervals come from weighting pieces of time anew. A sensor that could stand in for another, because both
always moved together, is listed as its rival: no interval shows that.

Columns of the regression that takes a still sensor's deviation apart, and least squares block by block.

Each neighbour has a curve of its own, a polynomial of u, how far it is from where the take began (in shares
of its range), and two neighbours may have products ``u1 u2``, ``u1**2 u2`` and ``u1 u2**2``. All of them are
zero where the take began: a neighbour's curve is what it does when it moves alone. Sums of products are kept
for each block of time, so that leaving out a block or drawing blocks anew costs one small solution.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass

import numpy as np

from glovecal_models.independence.answer import LEAST_MAX_PCT, LEAST_STD_PCT, AffectingShare

POWERS = (1, 2, 3, 4)
PRODUCTS = ((1, 1), (2, 1), (1, 2))
BLOCK_S = 1.0
"""Neighbouring frames err alike; pieces this long hardly do."""
FOLDS = 5
RIDGE = 1e-8
LEAST_CROSSTALK_PCT = 0.7
"""Smaller crosstalk (standard deviation, per cent of the range) is not looked for: a hand held still moves as
much."""
FEW = 3
"""Up to so many sensors all products stay in the fit: where joints move together a product that is left out
would be counted as one sensor's own, and no interval would show it."""
DRAWS = 300
_SWEEP = np.linspace(0.0, 1.0, 101)


def curve_columns(share: np.ndarray) -> np.ndarray:
    """Shape (N, len(POWERS)), of one sensor's ``share`` (N,)."""
    return np.column_stack([share**power for power in POWERS])


def product_columns(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Shape (N, len(PRODUCTS)), of two sensors' shares, each (N,)."""
    return np.column_stack([first**a * second**b for a, b in PRODUCTS])


class CouplingColumns:
    """Columns by name; the sums of products of each block, shape (B, P, P)."""

    def __init__(
        self,
        target: np.ndarray,
        moved: dict[str, np.ndarray],
        constants: np.ndarray,
        block: np.ndarray,
        pairs: Iterable[tuple[str, str]] = (),
    ) -> None:
        """``target`` (N,), each of ``moved`` (N,), ``constants`` (N, C) in every fit, ``block`` (N,)."""
        columns = [constants]
        self.groups: dict[str | tuple[str, str], list[int]] = {}
        place = constants.shape[1]
        for name, share in moved.items():
            columns.append(curve_columns(share))
            self.groups[name] = list(range(place, place + len(POWERS)))
            place += len(POWERS)
        for first, second in pairs:
            columns.append(product_columns(moved[first], moved[second]))
            self.groups[first, second] = list(range(place, place + len(PRODUCTS)))
            place += len(PRODUCTS)
        self.always = list(range(constants.shape[1]))
        whole = np.column_stack([*columns, target])
        _, number = np.unique(block, return_inverse=True)
        self.rows = np.bincount(number)
        starts = np.flatnonzero(np.r_[True, np.diff(number) > 0])
        self.sums = np.stack(
            [piece.T @ piece for piece in np.split(whole, starts[1:])]
        )  # blocks lie one after another

    def places(self, chosen: Sequence[str | tuple[str, str]]) -> list[int]:
        return [*self.always, *(place for name in chosen for place in self.groups[name])]

    def solve(self, chosen: Sequence[str | tuple[str, str]], weight: np.ndarray) -> np.ndarray:
        """Coefficients (of ``places``), each block counted ``weight`` (B,) times."""
        return _solve(np.tensordot(weight, self.sums, 1), self.places(chosen))

    def held_out_rms(self, chosen: Sequence[str | tuple[str, str]]) -> float:
        """RMS error on held-out blocks, every fifth at a time."""
        places, total, squared = self.places(chosen), self.sums.sum(axis=0), 0.0
        for fold in range(FOLDS):
            held_out = self.sums[fold::FOLDS].sum(axis=0)
            b = _solve(total - held_out, places)
            inner = held_out[np.ix_(places, places)]
            squared += float(held_out[-1, -1] - 2 * b @ held_out[places, -1] + b @ inner @ b)
        return float(np.sqrt(max(squared, 0.0) / self.rows.sum()))


def _solve(sums: np.ndarray, places: list[int]) -> np.ndarray:
    gram = sums[np.ix_(places, places)]
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-12))
    scaled = gram / np.outer(scale, scale) + RIDGE * np.eye(len(places))
    return np.linalg.solve(scaled, sums[places, -1] / scale) / scale


@dataclass(frozen=True)
class Coupling:
    shares: tuple[AffectingShare, ...]
    """Sensors that add something, the strongest first."""
    products: Mapping[tuple[str, str], np.ndarray]
    """Pairs whose common movement does something else than the sum of both; a number for each product."""
    unexplained_pct: float
    """RMS, on held-out pieces, of what no sensor explains."""
    constants: np.ndarray
    """Shape (C,): what stands before each of the constants."""
    curves: Mapping[str, np.ndarray]
    """Each sensor's own curve: a number for each power."""

    def crosstalk(self, moved: Mapping[str, np.ndarray]) -> np.ndarray | float:
        """Per cent of the range, shape (N,), crosstalk on the sensor; ``moved`` as it was learned."""
        alone = sum(curve_columns(moved[name]) @ own for name, own in self.curves.items() if name in moved)
        both = (
            product_columns(moved[first], moved[second]) @ own
            for (first, second), own in self.products.items()
            if first in moved and second in moved
        )
        return alone + sum(both)


def decompose(
    target: np.ndarray,
    moved: dict[str, np.ndarray],
    constants: np.ndarray,
    block: np.ndarray,
    coupled: Set[str] = frozenset(),
    *,
    at_once: bool = True,
) -> Coupling:
    """``target`` (N,) is the still sensor in per cent of its range, each of ``moved`` (N,) a joint in shares
    of its range from where it began, ``constants`` (N, C) what is in every fit. Sensors in ``coupled`` are
    cross-coupled themselves: one that is no cause still moves with the causes, so they come last. Products
    need joints that moved ``at_once``."""

    def columns(names: list[str], beside: list[str] | None = None) -> CouplingColumns:
        """``names`` with all their products, or with those that have one of ``beside`` in them."""
        pairs = [(a, b) for place, a in enumerate(names) for b in names[place + 1 :]] if at_once else []
        if beside is not None:
            pairs = [pair for pair in pairs if set(pair) & set(beside)]
        return CouplingColumns(target, moved, constants, block, pairs)

    chosen: list[str] = []
    for stage in ([name for name in moved if name not in coupled], list(moved)):
        waiting = [name for name in stage if name not in chosen]
        while (best := _next(columns([*chosen, *waiting], chosen[:FEW]), waiting, chosen)) is not None:
            chosen.append(best)
            waiting.remove(best)
    whole = columns(chosen)
    fitted = _pruned(whole, [*chosen, *_products(whole, chosen)])
    sensors = [name for name in fitted if isinstance(name, str)]
    if len(sensors) <= FEW:
        whole = columns(sensors)
        fitted = sensors + [name for name in whole.groups if not isinstance(name, str)]
    return _coupling(whole, fitted, moved, coupled)


def _coupling(
    columns: CouplingColumns, fitted: list, moved: dict[str, np.ndarray], coupled: Set[str]
) -> Coupling:
    draws = _draws(columns, fitted)
    shares = [
        _share(name, columns, fitted, draws, moved, _rivals(columns, fitted, name, list(moved), coupled))
        for name in fitted
        if isinstance(name, str)
    ]
    shares.sort(key=lambda item: -item.std_pct)
    places = columns.places(fitted)
    learned = {name: draws[0, [places.index(place) for place in columns.groups[name]]] for name in fitted}
    return Coupling(
        tuple(shares),
        {name: own for name, own in learned.items() if not isinstance(name, str)},
        columns.held_out_rms(fitted),
        draws[0, : len(columns.always)],
        {name: own for name, own in learned.items() if isinstance(name, str)},
    )


def follows_the_rule(std_pct: float, max_pct: float) -> bool:
    """Cross-coupled by the paper's rule."""
    return std_pct >= LEAST_STD_PCT or max_pct >= LEAST_MAX_PCT


def _next(columns: CouplingColumns, waiting: list[str], chosen: list[str]) -> str | None:
    """Which sensor lowers the error on held-out pieces the most, each with its products with those chosen
    first: crosstalk that ends when both are bent is seen no other way. None when none lowers it enough."""

    def with_products(names: list[str]) -> list:
        pairs = [pair for pair in columns.groups if not isinstance(pair, str) and set(pair) <= set(names)]
        return [*names, *pairs]

    error = columns.held_out_rms(with_products(chosen))
    with_it = {name: columns.held_out_rms(with_products([*chosen, name])) for name in waiting}
    best = min(with_it, key=lambda name: with_it[name], default=None)
    return best if best is not None and error**2 - with_it[best] ** 2 >= LEAST_CROSSTALK_PCT**2 else None


def _selected(columns: CouplingColumns, candidates: list, already: list) -> list:
    """Candidates that lower the error on held-out pieces, in the order in which they do."""
    chosen, waiting = [], list(candidates)
    error = columns.held_out_rms(already)
    while waiting:
        with_it = {name: columns.held_out_rms([*already, *chosen, name]) for name in waiting}
        best = min(with_it, key=lambda name: with_it[name])
        if error**2 - with_it[best] ** 2 < LEAST_CROSSTALK_PCT**2:
            break
        chosen.append(best)
        waiting.remove(best)
        error = with_it[best]
    return chosen


def _products(columns: CouplingColumns, chosen: list) -> list:
    return _selected(columns, [name for name in columns.groups if not isinstance(name, str)], chosen)


def _pruned(columns: CouplingColumns, fitted: list) -> list:
    """Drops what the rest does as well, the least needed first: products, then sensors without products."""
    for of_sensors in (False, True):
        while True:
            paired = {name for pair in fitted if not isinstance(pair, str) for name in pair}
            candidates = [n for n in fitted if isinstance(n, str) == of_sensors and n not in paired]
            error = columns.held_out_rms(fitted)
            without = {name: columns.held_out_rms([n for n in fitted if n != name]) for name in candidates}
            least = min(without, key=lambda name: without[name], default=None)
            if least is None or without[least] ** 2 - error**2 >= LEAST_CROSSTALK_PCT**2:
                break
            fitted = [name for name in fitted if name != least]
    return fitted


def _draws(columns: CouplingColumns, fitted: list) -> np.ndarray:
    """Coefficients with pieces of time weighted anew, shape (DRAWS + 1, P); the first counts each once.

    Weights are exponential (Rubin's Bayesian bootstrap, 1981): no piece is ever left out, as few of them hold
    the ends of a range.
    """
    random = np.random.default_rng(0)
    blocks = len(columns.rows)
    weights = random.exponential(size=(DRAWS, blocks))
    return np.stack([columns.solve(fitted, weight) for weight in (np.ones(blocks), *weights)])


def _share(
    name: str,
    columns: CouplingColumns,
    fitted: list,
    draws: np.ndarray,
    moved: dict[str, np.ndarray],
    rivals: tuple[str, ...],
) -> AffectingShare:
    places = columns.places(fitted)
    own = [places.index(place) for place in columns.groups[name]]
    low, high = float(moved[name].min()), float(moved[name].max())
    sweep = low + (high - low) * _SWEEP
    curves = draws[:, own] @ curve_columns(sweep).T
    std = curves.std(axis=1)
    largest = np.abs(curves - curves.mean(axis=1, keepdims=True)).max(axis=1)
    (std_low, std_high), (max_low, max_high) = (np.percentile(v[1:], [2.5, 97.5]) for v in (std, largest))
    coupled = float(np.mean((std[1:] >= LEAST_STD_PCT) | (largest[1:] >= LEAST_MAX_PCT)))
    is_undecided = 0.025 < coupled < 0.975 or (rivals and coupled > 0.5)
    affects = "undecided" if is_undecided else "yes" if coupled > 0.5 else "no"
    return AffectingShare(
        name, float(std[0]), float(std_low), float(std_high), float(largest[0]), float(max_low),
        float(max_high), affects, 100 * (high - low), rivals,
    )  # fmt: skip


def _rivals(
    columns: CouplingColumns, fitted: list, name: str, every: list, coupled: Set[str]
) -> tuple[str, ...]:
    """Sensors that would do as well in the place of ``name``; not those that only move with it."""
    others = [item for item in fitted if item != name]
    as_good = columns.held_out_rms(fitted) ** 2 + LEAST_CROSSTALK_PCT**2
    return tuple(
        item
        for item in every
        if item not in fitted
        and (name in coupled or item not in coupled)
        and columns.held_out_rms([*others, item]) ** 2 < as_good
    )
