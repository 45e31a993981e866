"""Low passes and moving averages of a finely sampled signal, worked out only at the rows that are read.

A first-order filter remembers one number: from one row to the next it is a weighted sum of the samples
between them, the same weights for all rows, and a recursion over rows. Times are in samples throughout.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np


def low_passed(signals: Sequence[np.ndarray], rows: Sequence[np.ndarray], tau: np.ndarray) -> np.ndarray:
    """(rows of all signals, K): first-order filters with time constants ``tau`` (K,).

    ``signals`` (F,) each with its own ``rows`` (N,), rising or falling. Exact for straight lines between
    every second sample, where all rows lie on such, and at rest before the first.
    """
    every = 2 if all(not (part % 2).any() for part in rows) else 1
    at = [part // every for part in rows]
    step = max(1, int(np.gcd.reduce(np.concatenate([np.diff(part) for part in at]), initial=0)))
    blocks, place = _blocks([signal[::every] for signal in signals], at, step)
    h = every / tau
    e = np.exp(-h)
    gain = (1 - e) / h
    weights = _weights(1 - gain, gain - e, e, step)
    passed = (blocks.reshape(-1, step + 1) @ weights.T).reshape(len(blocks), -1)
    # Half a second to load scipy.signal, whose recursion is no faster than one over rows of all filters.
    decay, remembered = np.tile(e**step, blocks.shape[1]), np.empty(passed.shape[1])
    for before, now in pairwise(passed):
        now += np.multiply(decay, before, out=remembered)
    result = passed.reshape(-1, len(tau))[place]
    result += np.repeat([signal[:1].sum() for signal in signals], [len(part) for part in rows])[:, None]
    return result


def _blocks(
    signals: Sequence[np.ndarray], at: Sequence[np.ndarray], step: int
) -> tuple[np.ndarray, np.ndarray]:
    """(M, T, step + 1) samples up to every ``step``-th of each signal, less its first, and where the rows
    ``at`` lie in (M, T): signals side by side, filled up behind their ends, where nothing is read."""
    ahead = [step + int(-part[:1].sum()) % step for part in at]
    count = max((len(signal) + more) // step for signal, more in zip(signals, ahead, strict=True)) + 1
    together = np.zeros((len(signals), count * step + 1))
    for row, signal, more in zip(together, signals, ahead, strict=True):
        row[more : more + len(signal)] = signal - signal[:1]
    blocks = np.lib.stride_tricks.sliding_window_view(together, step + 1, axis=1)[:, ::step]
    place = [
        ((part + more) // step - 1) * len(signals) + number
        for number, (part, more) in enumerate(zip(at, ahead, strict=True))
    ]
    return np.ascontiguousarray(blocks.swapaxes(0, 1)), np.concatenate(place)


def _weights(now: np.ndarray, before: np.ndarray, decay: np.ndarray, step: int) -> np.ndarray:
    """(K, step + 1) of the samples since the row before, the oldest first, in the recursion
    y = decay y_before + now x + before x_before; all (K,)."""
    powers = decay[:, None] ** np.arange(step)
    result = np.zeros((len(decay), step + 1))
    result[:, 1:] = (now[:, None] * powers)[:, ::-1]
    result[:, :-1] += (before[:, None] * powers)[:, ::-1]
    return result


def window_means(signal: np.ndarray, rows: np.ndarray, newest: np.ndarray, oldest: np.ndarray) -> np.ndarray:
    """(K, N): means of a signal (F,) between ``newest`` and ``oldest`` (K,) samples before each of ``rows``
    (N,); before its first sample the signal rests."""
    if len(signal) < 2:
        return np.repeat(signal[rows][None], len(newest), axis=0)
    rest = int(np.ceil(oldest.max(initial=0.0))) + 1
    sums = np.concatenate([[0.0], np.cumsum(0.5 * (signal[1:] + signal[:-1]))])
    sums = np.concatenate([signal[0] * np.arange(-rest, 0), sums, sums[-1:]])
    ago, place = np.unique(np.concatenate([newest, oldest]), return_inverse=True)
    until = _sums_until(sums, rows + rest, ago)
    new, old = place[: len(newest)], place[len(newest) :]
    result = until[new]
    result -= until[old]
    result /= (oldest - newest)[:, None]
    return result


def _sums_until(sums: np.ndarray, rows: np.ndarray, ago: np.ndarray) -> np.ndarray:
    """(K, N): running ``sums`` (F,) at times ``ago`` (K,), in samples, before each of ``rows`` (N,)."""
    whole = np.ceil(ago).astype(int)
    between = int(rows[1] - rows[0]) if len(rows) > 1 else 0
    if between > 0 and (np.diff(rows) == between).all():
        # Every ``between``-th sum side by side: what rows read is then one piece of it.
        beside = np.pad(sums, (0, -len(sums) % between)).reshape(-1, between).T.copy()
        view = np.lib.stride_tricks.sliding_window_view(beside, len(rows), axis=1)
        below = rows[0] - whole
        first = view[below % between, below // between]
        following = view[(below + 1) % between, (below + 1) // between]
    else:
        below = rows - whole[:, None]
        first, following = sums[below], sums[below + 1]
    following -= first
    following *= (whole - ago)[:, None]
    following += first
    return following
