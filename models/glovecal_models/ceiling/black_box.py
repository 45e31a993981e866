"""A black box of three parts: a line in all columns, boosted trees on what it leaves, products of columns.

The line carries what goes on beyond the range of the training takes, where trees stand still. Products (of
the reading with its running averages) carry a memory that depends on the bend, which trees resolve only in
steps. Each part is multiplied by a number from 0 to 1 that the other takes choose: a box that has learned
nothing predicts nothing, so that flexibility alone costs no error.

Everything recorded that an error may depend on, as columns; and the same columns with their tie cut.

Sensors and error are smoothed by one symmetric kernel: else every average over past readings gains, because
it removes noise. What smoothing leaves of that is told by a history that knows no direction: each column's
mean with its mirror image in time. It averages as much as the history does and knows nothing of what was
before. (The mirror image alone knows the direction of movement as well as the history does: of a lag it
gains all.)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from threadpoolctl import threadpool_limits

from glovecal_models.errors import BadInput
from glovecal_models.installation import not_installed
from glovecal_models.takes.take import Take

RIDGE_SHARE = 0.02
"""Penalty as a share of the rows, for columns of standard deviation one."""
PRODUCT_RIDGE_SHARES = (1e-3, 1e-2, 1e-1)
"""Among them the training takes choose, each third of them left out."""
TREES = 60
LEARNING_RATE = 0.1
LEAVES = 12
ROWS_IN_A_LEAF = 36
"""Six seconds: neighbouring rows say nearly the same."""
TREE_BINS = 63
COLUMNS_TRIED = 0.4
FOLDS = 4
PARTS = 3
CEILING_HZ = 30.0
ROW_EVERY = 5
"""Grid points; the kernel makes those between say the same."""
MOST_ROWS = 6000
"""Of all takes; longer recordings have fewer rows a second."""
KERNEL_S = 0.1
"""Standard deviation."""
LAGS_S = (0.1, 0.2, 0.4, 0.8, 1.4, 2.0)
AVERAGES_S = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 60.0)
EXTREMES_S = (2.0, 10.0, 60.0)
OTHERS_LAGS_S = (0.2, 0.8)
OTHERS_AVERAGES_S = (5.0,)
GROUPS = ("readings", "history", "context", "wearing and time")


@dataclass(frozen=True)
class Left:
    """What the box leaves of a target on takes it has not seen."""

    square: np.ndarray
    """For each take, the squared error summed over its rows."""
    without: Mapping[str, np.ndarray]
    """The same, with a group of columns exchanged for those of another take."""


def left_by_box(
    columns: np.ndarray,
    target: np.ndarray,
    take: np.ndarray,
    seed: int,
    exchanged: Mapping[str, tuple[slice, np.ndarray]] | None = None,
    products: Sequence[tuple[int, ...]] = (),
) -> Left:
    """``columns`` (N, P), NaN where unknown; ``target`` (N,); ``take`` (N,) numbers from 0, each with rows.

    ``exchanged``: for groups of columns their place, and what stands there instead (N, columns).
    ``products``: places of columns that are multiplied with one another.
    """
    exchanged = exchanged or {}
    try:
        import sklearn.ensemble  # noqa: F401  a second to load; the limit below is of pools that are there
    except ModuleNotFoundError as error:
        raise BadInput(not_installed("the ceiling", "scikit-learn")) from error
    count = int(take.max()) + 1
    parts = np.zeros((PARTS, len(target)))
    other = {name: np.zeros((PARTS, len(target))) for name in exchanged}
    with threadpool_limits(limits=1):
        for fold in range(min(FOLDS, count)):
            held = take % min(FOLDS, count) == fold
            box = _Box(columns[~held], target[~held], take[~held], seed, products)
            parts[:, held] = box.predict(columns[held])
            for name, (place, values) in exchanged.items():
                changed = columns[held].copy()
                changed[:, place] = values[held]
                other[name][:, held] = box.predict(changed)
    shares = _shares(parts, target, take, count)[:, take]

    def squares(predicted: np.ndarray) -> np.ndarray:
        return np.bincount(take, (target - (shares * predicted).sum(axis=0)) ** 2, count)

    return Left(squares(parts), {name: squares(values) for name, values in other.items()})


class _Box:
    """Fitted to some takes."""

    def __init__(
        self, columns: np.ndarray, target: np.ndarray, take: np.ndarray, seed: int,
        products: Sequence[tuple[int, ...]],
    ) -> None:  # fmt: skip
        from sklearn.ensemble import HistGradientBoostingRegressor

        self._products = products
        self._standard = _Standard(columns)
        x = self._standard.of(columns)
        self._level = float(target.mean())
        gram = x.T @ x + RIDGE_SHARE * len(x) * np.eye(x.shape[1])
        self._weights = np.linalg.solve(gram, x.T @ (target - self._level))
        left = target - self._line(x)
        if products:
            multiplied = self._multiplied(x)
            self._standard_products = _Standard(multiplied)
            bank = self._standard_products.of(multiplied)
            # Not of what the line leaves: that follows other columns by chance, and would hide a memory.
            self._product_weights = _ridge(bank, target - self._level, take)
        self._trees = HistGradientBoostingRegressor(
            max_iter=TREES, learning_rate=LEARNING_RATE, max_leaf_nodes=LEAVES,
            min_samples_leaf=ROWS_IN_A_LEAF, max_bins=TREE_BINS, max_features=COLUMNS_TRIED,
            early_stopping=False,  # pyright: ignore[reportArgumentType]
            random_state=seed,
        )  # fmt: skip
        # Trees cannot be grown on a column of which nothing is known, such as the past in takes of a second.
        self._trees.fit(columns[:, self._standard.known], left)

    def predict(self, columns: np.ndarray) -> np.ndarray:
        """(parts, N)"""
        x = self._standard.of(columns)
        bank = np.zeros(len(x))
        if self._products:
            bank = self._standard_products.of(self._multiplied(x)) @ self._product_weights
        return np.stack([self._line(x), bank, self._trees.predict(columns[:, self._standard.known])])

    def _line(self, x: np.ndarray) -> np.ndarray:
        return self._level + x @ self._weights

    def _multiplied(self, x: np.ndarray) -> np.ndarray:
        single = dict.fromkeys(place for places in self._products for place in places)
        return np.column_stack(
            [
                x[:, list(single)],
                *(np.prod(x[:, list(places)], axis=1) for places in self._products),
            ]
        )


class _Standard:
    """Columns with the mean and the standard deviation that they had in training; unknown is the mean."""

    def __init__(self, columns: np.ndarray) -> None:
        known = np.isfinite(columns)
        counts = np.maximum(known.sum(axis=0), 1)
        self.known = known.any(axis=0)
        self._mean = np.where(known, columns, 0.0).sum(axis=0) / counts
        spread = np.sqrt((np.where(known, columns - self._mean, 0.0) ** 2).sum(axis=0) / counts)
        self._scale = np.where(spread > 0, spread, np.inf)

    def of(self, columns: np.ndarray) -> np.ndarray:
        return np.nan_to_num((columns - self._mean) / self._scale)


def _ridge(x: np.ndarray, target: np.ndarray, take: np.ndarray) -> np.ndarray:
    """Weights with the penalty that leaves least on takes left out."""
    thirds = np.unique(take, return_inverse=True)[1] % 3
    grams = [x[thirds == third].T @ x[thirds == third] for third in range(3)]
    products = [x[thirds == third].T @ target[thirds == third] for third in range(3)]

    def weights(penalty: float, without: int | None) -> np.ndarray:
        kept = [third for third in range(3) if third != without]
        rows = sum(int(np.count_nonzero(thirds == third)) for third in kept)
        gram = sum(grams[third] for third in kept) + penalty * max(rows, 1) * np.eye(x.shape[1])
        return cho_solve(cho_factor(gram), sum(products[third] for third in kept))

    def left(penalty: float) -> float:
        found = [weights(penalty, third) for third in range(3)]
        return sum(
            float(w @ gram @ w - 2 * w @ product)
            for w, gram, product in zip(found, grams, products, strict=True)
        )

    return weights(min(PRODUCT_RIDGE_SHARES, key=left), None)


def _shares(parts: np.ndarray, target: np.ndarray, take: np.ndarray, count: int) -> np.ndarray:
    """(parts, takes): for each take what multiples of the parts, 0 to 1, fit the other takes best."""
    from scipy.optimize import lsq_linear  # slow to load

    rows = [parts[:, take == number] for number in range(count)]
    grams = np.array([part @ part.T for part in rows])
    products = np.array([part @ target[take == number] for number, part in enumerate(rows)])
    found = np.zeros((len(parts), count))
    for number in range(count):
        gram = grams.sum(axis=0) - grams[number]
        gram[np.diag_indices(len(parts))] += 1e-9 * max(float(np.trace(gram)), 1e-12)
        root = np.linalg.cholesky(gram).T
        wanted = np.linalg.solve(root.T, products.sum(axis=0) - products[number])
        found[:, number] = lsq_linear(root, wanted, (0.0, 1.0), method="bvls").x
    return found


@dataclass(frozen=True)
class TakeColumns:
    """One take on an even grid of G times."""

    time_s: np.ndarray
    """(G,)"""
    groups: Mapping[str, np.ndarray]
    """(G, columns) by the names of ``GROUPS``."""
    symmetric_history: np.ndarray
    """The columns of the history, each averaged with its mirror image in time."""


def recorded_columns(
    takes: Sequence[Take], readings: Sequence[np.ndarray], own: Sequence[int], scale: np.ndarray
) -> list[TakeColumns]:
    """``readings``: for each take (N, S); ``own``: sensors with a long history; ``scale`` (S,)."""
    context = sorted({name for take in takes for name in take.context})
    wearings = list(dict.fromkeys(take.wearing for take in takes))
    shares_clock = _shares_clock(takes)
    seen: dict[str, list[float]] = {}
    found = []
    for take, values in zip(takes, readings, strict=True):
        time = _grid(take)
        smooth = _smoothed(_at(time, take.time_s, values / scale))
        past = _history(smooth, own)
        mirrored = _history(smooth[::-1], own)[::-1]
        before = seen.setdefault(take.wearing, [])
        first = before[0] if before and shares_clock else take.start_s
        session = [
            *(np.full(len(time), float(take.wearing == name)) for name in wearings),
            np.full(len(time), float(len(before))),
            time - first,
        ]
        before.append(take.start_s)
        groups = {
            "readings": smooth,
            "history": past,
            "context": _context(take, time, context),
            "wearing and time": np.column_stack(session),
        }
        found.append(TakeColumns(time, groups, (past + mirrored) / 2))
    return found


def own_averages(own: Sequence[int], sensors: int) -> dict[int, list[int]]:
    """For each own sensor the places of its running averages in the history."""
    found, at = {}, 0
    for sensor in range(sensors):
        if sensor in own:
            found[sensor] = list(range(at + len(LAGS_S), at + len(LAGS_S) + len(AVERAGES_S)))
            at += len(LAGS_S) + len(AVERAGES_S) + 2 * len(EXTREMES_S)
        else:
            at += len(OTHERS_LAGS_S) + len(OTHERS_AVERAGES_S)
    return found


def smoothed_error(time_s: np.ndarray, take: Take, error: np.ndarray) -> np.ndarray:
    """``error`` (N,) at the grid ``time_s`` (G,), smoothed as readings are; NaN where none was measured."""
    known = np.isfinite(error)
    if known.sum() < 2:
        return np.full(len(time_s), np.nan)
    near = np.interp(time_s, take.time_s, known.astype(float)) > 0.99
    values = np.where(near, np.interp(time_s, take.time_s[known], error[known]), 0.0)
    weight, total = (_smoothed(part, "constant") for part in (near.astype(float), values))
    return np.where(near, total / np.maximum(weight, 1e-9), np.nan)


def exchanged(parts: Sequence[np.ndarray], order: Sequence[int]) -> list[np.ndarray]:
    """For each take the rows of another one, ``order`` says which, shifted by half its length."""
    found = []
    for part, other in zip(parts, order, strict=True):
        source = parts[other]
        at = (np.arange(len(part)) + len(source) // 2) % max(len(source), 1)
        found.append(source[at])
    return found


def exchange_order(wearings: Sequence[str], generator: np.random.Generator) -> list[int]:
    """No take keeps its own, and few get those of their own wearing."""
    count = len(wearings)
    best, fewest = list(range(count)), count + 1
    for _ in range(50):
        order = generator.permutation(count).tolist()
        same = sum(wearings[at] == wearings[other] for at, other in enumerate(order))
        kept = sum(at == other for at, other in enumerate(order))
        if not kept and same < fewest:
            best, fewest = order, same
    return best


def _shares_clock(takes: Sequence[Take]) -> bool:
    """Whether the takes of a wearing follow one another on one clock."""
    last: dict[str, float] = {}
    for take in takes:
        if take.start_s < last.get(take.wearing, -np.inf):
            return False
        last[take.wearing] = float(take.time_s[-1])
    return True


def _grid(take: Take) -> np.ndarray:
    return take.time_s[0] + np.arange(int(take.duration_s * CEILING_HZ) + 1) / CEILING_HZ


def _at(time: np.ndarray, frames: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.column_stack([np.interp(time, frames, column) for column in values.T])


def _smoothed(values: np.ndarray, beyond: str = "nearest") -> np.ndarray:
    """``beyond``: what stands beyond the ends, a ``mode`` of SciPy's filters."""
    from scipy.ndimage import gaussian_filter1d  # slow to load, and every service loads this file

    return gaussian_filter1d(values, KERNEL_S * CEILING_HZ, axis=0, mode=beyond)


def _context(take: Take, time: np.ndarray, names: Sequence[str]) -> np.ndarray:
    columns = []
    for name in names:
        values = take.context.get(name)
        known = np.zeros(0, bool) if values is None else np.isfinite(values)
        if values is None or not known.any():
            columns.append(np.full(len(time), np.nan))
        else:
            columns.append(np.interp(time, take.time_s[known], values[known]))
    return np.column_stack(columns) if columns else np.empty((len(time), 0))


def _history(smooth: np.ndarray, own: Sequence[int]) -> np.ndarray:
    """All as differences from the reading now."""
    columns = []
    for sensor, x in enumerate(smooth.T):
        lags, averages, extremes = OTHERS_LAGS_S, OTHERS_AVERAGES_S, ()
        if sensor in own:
            lags, averages, extremes = LAGS_S, AVERAGES_S, EXTREMES_S
        columns += [_before(x, lag) - x for lag in lags]
        columns += [_average(x, tau) - x for tau in averages]
        columns += [_largest(sign * x, window) - sign * x for window in extremes for sign in (1.0, -1.0)]
    return np.column_stack(columns)


def _before(x: np.ndarray, lag_s: float) -> np.ndarray:
    steps = round(lag_s * CEILING_HZ)
    return np.concatenate([np.full(min(steps, len(x)), np.nan), x[: max(len(x) - steps, 0)]])


def _average(x: np.ndarray, tau_s: float) -> np.ndarray:
    """Exponential, of what was seen so far."""
    from scipy.signal import lfilter  # takes a second to load, which most commands need not wait for

    keep = np.exp(-1.0 / (tau_s * CEILING_HZ))
    total, weight = (lfilter([1.0], [1.0, -keep], values) for values in (x, np.ones(len(x))))
    return np.asarray(total) / np.asarray(weight)


def _largest(x: np.ndarray, window_s: float) -> np.ndarray:
    """Of the last ``window_s``; by doubling, so that long windows cost little."""
    width, result = round(window_s * CEILING_HZ), x.copy()
    done = 1
    while done < width:
        step = min(done, width - done)
        result[step:] = np.maximum(result[step:], result[:-step].copy())
        done += step
    return result
