"""Low passes and moving averages of a finely sampled signal, worked out only at the rows that are read.

A first-order filter remembers one number: from one row to the next it is a weighted sum of the samples
between them, the same weights for all rows, and a recursion over rows. Times are in samples throughout.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from glovecal_models.effects.base.signals import as_slice

NONE = np.empty((2, 0))
WHOLE = 1e-9
"""Of a sample: times so near to one lie on it."""


def low_passed(
    signals: Sequence[np.ndarray], rows: Sequence[np.ndarray], tau: np.ndarray, in_a_row: np.ndarray = NONE
) -> list[np.ndarray]:
    """(N, K + M) of each signal, less its first sample: first-order filters with time constants ``tau`` (K,),
    and two such in a row with those of ``in_a_row`` (2, M).

    ``signals`` (F,) each with its own ``rows`` (N,), rising or falling. Exact for straight lines between
    every second sample, where all rows lie on such, and at rest before the first.
    """
    every = 2 if all(not (part % 2).any() for part in rows) else 1
    at = [part // every for part in rows]
    step = max(1, int(np.gcd.reduce(np.concatenate([np.diff(part) for part in at]), initial=0)))
    blocks, places = _blocks([signal[::every] for signal in signals], at, step)
    h = every / np.concatenate([tau, *in_a_row])
    e = np.exp(-h)
    gain = (1 - e) / h
    weights = _weights(1 - gain, gain - e, e, step)
    # Two filters in a row are a difference of two, in partial fractions.
    first, second = in_a_row
    weights[len(tau) :] *= np.concatenate([first, -second] / (first - second))[:, None]
    passed = (blocks.reshape(-1, step + 1) @ weights.T).reshape(len(blocks), -1)
    # Half a second to load scipy.signal, whose recursion is no faster than one over rows of all filters.
    decay, remembered = np.tile(e**step, len(signals)), np.empty(passed.shape[1])
    for before, now in pairwise(passed):
        now += np.multiply(decay, before, out=remembered)
    each, count = passed.reshape(len(blocks), len(signals), len(h)), len(tau) + len(first)
    if len(first):
        each[:, :, len(tau) : count] += each[:, :, count:]
    return [each[as_slice(place), number, :count] for number, place in enumerate(places)]


def _blocks(
    signals: Sequence[np.ndarray], at: Sequence[np.ndarray], step: int
) -> tuple[np.ndarray, list[np.ndarray]]:
    """(M, T, step + 1) samples up to every ``step``-th of each signal, less its first, and where among M the
    rows ``at`` of each lie: signals side by side, filled up behind their ends, where nothing is read."""
    ahead = [step + int(-part[:1].sum()) % step for part in at]
    count = max((len(signal) + more) // step for signal, more in zip(signals, ahead, strict=True)) + 1
    together = np.zeros((len(signals), count * step + 1))
    for row, signal, more in zip(together, signals, ahead, strict=True):
        row[more : more + len(signal)] = signal - signal[:1]
    blocks = np.lib.stride_tricks.sliding_window_view(together, step + 1, axis=1)[:, ::step]
    places = [(part + more) // step - 1 for part, more in zip(at, ahead, strict=True)]
    return np.ascontiguousarray(blocks.swapaxes(0, 1)), places


def _weights(now: np.ndarray, before: np.ndarray, decay: np.ndarray, step: int) -> np.ndarray:
    """(K, step + 1) of the samples since the row before, the oldest first, in the recursion
    y = decay y_before + now x + before x_before; all (K,)."""
    powers = decay[:, None] ** np.arange(step)
    result = np.zeros((len(decay), step + 1))
    result[:, 1:] = (now[:, None] * powers)[:, ::-1]
    result[:, :-1] += (before[:, None] * powers)[:, ::-1]
    return result


def running_sums(signal: np.ndarray) -> np.ndarray:
    """(F,): what straight lines between the samples (F,) cover from the first one on."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (signal[1:] + signal[:-1]))])


def window_means(
    sums: np.ndarray, rows: np.ndarray, newest: np.ndarray, oldest: np.ndarray, result: np.ndarray
) -> None:
    """Means of a signal, given by its ``running_sums`` (F,), between ``newest`` and ``oldest`` (K,) samples
    before each of ``rows`` (N,), written to ``result`` (K, N)."""
    ago, place = np.unique(np.concatenate([newest, oldest]), return_inverse=True)
    until = _sums_until(sums, rows, ago)
    new, old = place[: len(newest)], place[len(newest) :]
    np.subtract(until[new], until[old], out=result)
    result /= (oldest - newest)[:, None]


def _sums_until(sums: np.ndarray, rows: np.ndarray, ago: np.ndarray) -> np.ndarray:
    """(K, N): running ``sums`` (F,) at times ``ago`` (K,), in samples, before each of ``rows`` (N,)."""
    whole = np.ceil(ago - WHOLE).astype(int)
    result = read_before(sums, rows, whole)
    between = np.flatnonzero(whole - ago > WHOLE)
    if len(between):
        following = read_before(sums, rows, whole[between] - 1)
        following -= result[between]
        following *= (whole - ago)[between, None]
        result[between] += following
    return result


def read_before(values: np.ndarray, rows: np.ndarray, ago: np.ndarray) -> np.ndarray:
    """(K, N): ``values`` (F,) that lie ``ago`` (K,) samples before each of ``rows`` (N,)."""
    between = int(rows[1] - rows[0]) if len(rows) > 1 else 0
    if between <= 0 or not (np.diff(rows) == between).all():
        return values[rows - ago[:, None]]
    # Every ``between``-th value side by side: what rows read is then one piece of it.
    beside = np.concatenate([values, np.zeros(-len(values) % between)]).reshape(-1, between).T.copy()
    view = np.lib.stride_tricks.sliding_window_view(beside, len(rows), axis=1)
    first = rows[0] - ago
    return view[first % between, first // between]
