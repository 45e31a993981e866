"""The angle of a joint after each form of delay, read off a fine sampling of it.

A pure delay and a mean over a window are read from samples, or from their running sums, a cell at a time; a
low pass is a recursion over rows, for all cells together. Either stays as it lies in memory.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise

import numpy as np

from glovecal_models.effects.base.signals import as_slice

STEP_S = 0.0025
EVEN_S = 1e-6
FIRST_POLE_SHARE = 0.65
"""Of the delay of two poles."""
WINDOW_SHARE = 0.6
"""Length of a delayed window, of that of a moving average as late: a raised cosine has 0.63."""


class DelayForm(IntEnum):
    """What a cell does to the angle; its delay is the mean time it takes."""

    PURE = 0
    ONE_POLE = 1
    TWO_POLES = 2
    MOVING_AVERAGE = 3
    DELAYED_WINDOW = 4


@dataclass(frozen=True)
class FineAngles:
    """The angles of one take on times ``STEP_S`` apart, cubic between its rows: straight lines would flatten
    fast motion as a filter does."""

    angles: np.ndarray
    """(R, F), degrees."""
    at: np.ndarray
    """(N,) places of the take's rows among the fine times."""

    @classmethod
    def of(cls, time: np.ndarray, own: np.ndarray) -> FineAngles:
        """``own``: (N, R)."""
        if len(time) < 2:
            return cls(own.T.astype(float), np.arange(len(time)))
        from scipy.interpolate import CubicSpline  # slow to load, too

        factor = max(1, round(float(np.median(np.diff(time))) / STEP_S))
        fine_time = time[0] + STEP_S * np.arange((len(time) - 1) * factor + 1)
        fine = CubicSpline(time, own)(np.clip(fine_time, time[0], time[-1]))
        at = np.clip(np.searchsorted(fine_time, time - EVEN_S), 0, len(fine) - 1)
        return cls(np.ascontiguousarray(fine.T), at)

    def track(self, joint: int, rows: np.ndarray) -> Track:
        return Track(self.angles[joint], self.at[rows])


@dataclass(frozen=True)
class Track:
    """The angle of one joint in one take."""

    fine: np.ndarray
    """(F,), degrees."""
    at: np.ndarray
    """(N,) places of the fitted rows among the fine times."""

    @property
    def backwards(self) -> Track:
        return Track(self.fine[::-1], len(self.fine) - 1 - self.at)


@dataclass(frozen=True)
class MovedAngles:
    """Of one track, in the order of ``MovedCells``."""

    read: np.ndarray
    """(K1, N), degrees."""
    passed: tuple[np.ndarray, ...]
    """(N, K2) late and (N, K3) early low passes of the angle less where it rests."""
    rested: tuple[float, ...]
    """Where that is for each of the two."""

    def differences(
        self, rows: slice, target: np.ndarray, slope: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """``target`` (M,) less ``slope`` (M,) times each cell at some ``rows``: (K1, M) and (M, K2 + K3)."""
        by_cell = self.read[:, rows] * slope
        np.subtract(target, by_cell, out=by_cell)
        ends = np.cumsum([part.shape[1] for part in self.passed]).tolist()
        by_row = np.empty((len(target), ends[-1]))
        for part, rested, first, end in zip(self.passed, self.rested, [0, *ends], ends, strict=False):
            mine = by_row[:, first:end]
            np.multiply(part[rows], slope[:, None], out=mine)
            np.subtract((target - rested * slope)[:, None], mine, out=mine)
        return by_cell, by_row


@dataclass(frozen=True)
class MovedCells:
    """The cells that do move the angle, in the order in which they are worked out."""

    order: np.ndarray
    """(K,) their places among all: first those that are read, K1, then the low passes, K2."""
    pure_s: np.ndarray
    """Delays of those that are read first, below zero for earlier."""
    newest: np.ndarray
    """For each window its end, in fine samples before a row; below zero after it."""
    oldest: np.ndarray
    """And its beginning."""
    late: tuple[np.ndarray, np.ndarray]
    """Time constants, in fine samples: of one pole (A,), and of two in a row (2, B)."""
    early: np.ndarray
    """Of one pole that is run backwards in time."""

    @classmethod
    def of(cls, form: np.ndarray, delay_s: np.ndarray) -> MovedCells:
        """``form`` and ``delay_s`` (K,); cells without a delay are left out."""
        pure = np.flatnonzero((form == DelayForm.PURE) & (delay_s != 0))
        is_window = np.isin(form, (DelayForm.MOVING_AVERAGE, DelayForm.DELAYED_WINDOW))
        window = np.flatnonzero(is_window & (delay_s != 0))
        share = np.where(form[window] == DelayForm.DELAYED_WINDOW, WINDOW_SHARE, 1.0)
        middle, half = delay_s[window] / STEP_S, np.abs(delay_s[window]) * share / STEP_S
        one = np.flatnonzero((form == DelayForm.ONE_POLE) & (delay_s > 0))
        two = np.flatnonzero((form == DelayForm.TWO_POLES) & (delay_s > 0))
        early = np.flatnonzero((form == DelayForm.ONE_POLE) & (delay_s < 0))
        shares = np.array([FIRST_POLE_SHARE, 1 - FIRST_POLE_SHARE])
        return cls(
            np.concatenate([pure, window, one, two, early]),
            delay_s[pure],
            middle - half,
            middle + half,
            (delay_s[one] / STEP_S, shares[:, None] * delay_s[two] / STEP_S),
            -delay_s[early] / STEP_S,
        )

    def of_tracks(self, tracks: Sequence[Track]) -> Iterator[MovedAngles]:
        """One for each."""
        late = low_passed([track.fine for track in tracks], [track.at for track in tracks], *self.late)
        back = [track.backwards for track in tracks]
        early = low_passed([track.fine for track in back], [track.at for track in back], self.early)
        for track, *passed in zip(tracks, late, early, strict=True):
            rested = tuple(float(track.fine[end : end + 1 or None].sum()) for end in (0, -1))
            yield MovedAngles(self._read(track), tuple(passed), rested)

    def _read(self, track: Track) -> np.ndarray:
        """(K1, N)."""
        shifts = np.round(self.pure_s / STEP_S).astype(int)
        reach = int(
            np.ceil(max(np.abs(each).max(initial=0.0) for each in (shifts, self.newest, self.oldest)))
        )
        if not len(track.at):
            return np.empty((len(shifts) + len(self.newest), 0))
        fine, rest = track.fine, np.ones(reach + 1)
        rested = np.concatenate([fine[0] * rest, fine, fine[-1] * rest])
        at = track.at + len(rest)
        moved = np.empty((len(shifts) + len(self.newest), len(at)))
        moved[: len(shifts)] = read_before(rested, at, shifts)
        window_means(running_sums(rested), at, self.newest, self.oldest, moved[len(shifts) :])
        return moved


# Low passes and moving averages of a finely sampled signal, worked out only at the rows that are read. A
# first-order filter remembers one number: from one row to the next it is a weighted sum of the samples
# between them, the same weights for all rows, and a recursion over rows. Times are in samples throughout.


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
