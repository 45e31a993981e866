"""How corrections go from frame to frame: each frame by itself, or with a memory.

A memory is a recursion over frames, the same for a whole take and for a live stream.
"""

from __future__ import annotations

import itertools
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from glovecal_models.effects.base.comparison import EffectComparison
from glovecal_models.effects.base.effect import CorrectionEffect, Dynamics, Stream
from glovecal_models.effects.base.signals import GloveFrames, Settings, Signals, as_slice

LEAST_SETTLING_S = 1.0
"""An effect with a memory counts as settled after this or, if longer, its longest time constant."""


class OwnDynamics(CorrectionEffect, Dynamics):
    """A correction that answers for its dynamics itself."""

    @property
    def dynamics(self) -> Dynamics:
        return self

    def columns_of_takes(
        self, takes: Sequence[Signals], settings: Settings, shape: np.ndarray
    ) -> list[np.ndarray]:
        return [self.columns(take, settings, shape) for take in takes]

    def transient_s(self, shape: np.ndarray, settings: Settings) -> float:
        if not self.has_memory or not len(shape):
            return 0.0
        times = [shape[:, at].max() for at, item in enumerate(self.shape.parameters) if item.unit == "s"]
        return float(max([LEAST_SETTLING_S, *times]))


class InstantEffect(OwnDynamics):
    """An effect without memory: each frame's columns depend on that frame alone."""

    def stream(self, settings: Settings, shape: np.ndarray) -> Stream:
        return _InstantStream(self, settings, shape)


class _InstantStream(Stream):
    def __init__(self, effect: InstantEffect, settings: Settings, shape: np.ndarray) -> None:
        self._effect, self._settings, self._shape = effect, settings, shape

    def columns(self, frame: Signals) -> np.ndarray:
        return self._effect.columns(frame, self._settings, self._shape)

    def reset(self) -> None:
        """There is nothing to forget."""

    @classmethod
    def together(cls, streams: Sequence[Any], frames: GloveFrames) -> np.ndarray:
        first, signals = streams[0], frames.as_one()
        if signals is None:
            return super().together(streams, frames)
        return first._effect.columns(signals, first._settings, first._shape)


LONGEST_GAP_S = 1.0
"""After a longer pause the state is forgotten: the hand may have done anything meanwhile."""
BLOCK_FRAMES = 256
"""So many frames are prepared at once: enough to be quick, few enough to stay in the processor's cache."""
BLOCK_VALUES = 100_000
"""Of several takes side by side so many values at once, likewise."""
FRAME_VALUES = 1_500
"""So many values of a frame are worth more takes beside: a frame costs mostly the call."""


class HistoryEffect(OwnDynamics):
    """Implement ``start`` and ``step``; batch and stream follow, equal to the last bit and causal."""

    has_memory: bool = True
    comparison: EffectComparison = EffectComparison(needs_movement=True)

    @abstractmethod
    def start(self, own: np.ndarray, settings: Settings, shape: np.ndarray) -> Any:
        """The state in which a hand that rested at ``own`` (L,) degrees would be."""

    @abstractmethod
    def step(
        self, state: Any, elapsed_s: float, own: np.ndarray, settings: Settings, shape: np.ndarray
    ) -> np.ndarray:
        """Columns (L, C) of the next frame; changes ``state`` in place."""

    def columns(self, take: Signals, settings: Settings, shape: np.ndarray) -> np.ndarray:
        elapsed, frames = elapsed_s(take.time_s), len(take)
        result = np.empty((frames, take.own.shape[1], len(self.weights(settings).names)))
        for part in unbroken(take.time_s):
            state = self.start(take.own[part.start], settings, shape)
            for first in range(part.start, part.stop, BLOCK_FRAMES):
                block = slice(first, min(first + BLOCK_FRAMES, part.stop))
                result[block] = self.run(state, elapsed[block], take.own[block], settings, shape)
        return result

    def drawn_weights(self, prior_sd: np.ndarray, generator: np.random.Generator) -> np.ndarray:
        """All of one sign: parts of one memory do not undo each other."""
        sign = generator.choice([-1.0, 1.0])
        return sign * np.abs(super().drawn_weights(prior_sd, generator))

    def unsettled(self, take: Signals, settings: Settings, shape: np.ndarray) -> np.ndarray:
        """With time it is forgotten."""
        settles_s, result = self.transient_s(shape, settings), np.empty(take.own.shape, dtype=bool)
        for part in unbroken(take.time_s):
            result[part] = (take.time_s[part] - take.time_s[part][:1] < settles_s)[:, None]
        return result

    def stream(self, settings: Settings, shape: np.ndarray) -> Stream:
        return _HistoryStream(self, settings, shape)

    def run(
        self, state: Any, elapsed_s: np.ndarray, own: np.ndarray, settings: Settings, shape: np.ndarray
    ) -> np.ndarray:
        """Columns (B, L, C) of the next B frames, ``elapsed_s`` (B,) after one another; ``own`` is (B, L).

        The same as B calls of ``step``; an effect overrides it when it can be quicker about it.
        """
        each = zip(elapsed_s.tolist(), own, strict=True)
        return np.stack([self.step(state, elapsed, joint, settings, shape) for elapsed, joint in each])


class ArrayStateEffect(HistoryEffect):
    """Its state is one array (L, ...), so that several gloves of a model are stepped together."""

    @abstractmethod
    def start(self, own: np.ndarray, settings: Settings, shape: np.ndarray) -> np.ndarray: ...

    @abstractmethod
    def step(
        self,
        state: np.ndarray,
        elapsed_s: float | np.ndarray,
        own: np.ndarray,
        settings: Settings,
        shape: np.ndarray,
    ) -> np.ndarray:
        """As for one glove; also for G gloves: state (G, L, ...), elapsed_s (G, 1, 1), own (G, L)."""

    def run(
        self, state: np.ndarray, elapsed_s: np.ndarray, own: np.ndarray, settings: Settings, shape: np.ndarray
    ) -> np.ndarray:
        return self.run_takes(state[None], elapsed_s[:, None], own[:, None], settings, shape)[:, 0]

    def run_takes(
        self, state: np.ndarray, elapsed_s: np.ndarray, own: np.ndarray, settings: Settings, shape: np.ndarray
    ) -> np.ndarray:
        """Columns (B, T, L, C) of the next B frames of T takes: state (T, L, ...), ``elapsed_s`` (B, T), own
        (B, T, L). The same as B calls of ``step``; an effect overrides it when it can be quicker about it."""
        each = zip(elapsed_s[..., None, None], own, strict=True)
        return np.stack([self.step(state, elapsed, joint, settings, shape) for elapsed, joint in each])

    def columns_of_takes(
        self, takes: Sequence[Signals], settings: Settings, shape: np.ndarray
    ) -> list[np.ndarray]:
        """Takes are run side by side, a few at a time where a frame of one has many values already."""
        lanes, added = shape.shape[0], len(self.weights(settings).names)
        found = [np.empty((len(take), lanes, added)) for take in takes]
        every = [np.arange(len(take)) for take in takes]
        self._run(takes, settings, shape, every, [part[:, None] for part in found])
        return found

    def columns_by_lane(
        self,
        takes: Sequence[Signals],
        settings: Settings,
        shape: np.ndarray,
        rows: Sequence[np.ndarray | slice],
        lanes: int,
        *,
        are_backwards: bool = False,
    ) -> list[np.ndarray]:
        """The same at some rows of each take, (L, M, G, C): ``shape`` (G L, P) are shapes of ``lanes``.

        ``are_backwards``: the takes are played backwards, ``rows`` are those of the takes as they were.
        """
        added, step = len(self.weights(settings).names), -1 if are_backwards else 1
        found, kept, written = [], [], []
        for take, some in zip(takes, rows, strict=True):
            at = np.arange(len(take))[::step][some]
            found.append(np.empty((lanes, len(at), len(shape) // lanes, added)))
            kept.append(at[::step])
            written.append(found[-1].transpose(1, 2, 0, 3)[::step])
        self._run(takes, settings, shape, kept, written)
        return found

    def _run(
        self,
        takes: Sequence[Signals],
        settings: Settings,
        shape: np.ndarray,
        kept: Sequence[np.ndarray],
        written: Sequence[np.ndarray],
    ) -> None:
        """Write the columns at rising rows ``kept`` (M,) of each take to ``written`` (M, G, L, C)."""
        strips = []
        for take, rows, columns in zip(takes, kept, written, strict=True):
            elapsed = elapsed_s(take.time_s)
            for part in unbroken(take.time_s):
                some = slice(*np.searchsorted(rows, [part.start, part.stop]).tolist())
                if part.stop > part.start and some.stop > some.start:
                    mine = rows[some] - part.start
                    strips.append(_Strip(take.own[part], elapsed[part], mine, columns[some]))
        strips.sort(key=lambda strip: -len(strip.own))
        most = max(FRAME_VALUES // max(len(shape) * written[0].shape[-1], 1), 1) if strips else 1
        for first in range(0, len(strips), most):
            self._run_strips(strips[first : first + most], settings, shape)

    def _run_strips(self, strips: Sequence[_Strip], settings: Settings, shape: np.ndarray) -> None:
        """Write the columns of ``strips``, the longest first."""
        states = np.array([self.start(strip.own[0], settings, shape) for strip in strips])
        values = len(strips) * strips[0].columns[:1].size
        block = min(max(BLOCK_VALUES // max(values, 1), 1), BLOCK_FRAMES)
        for first in range(0, len(strips[0].own), block):
            going = [strip for strip in strips if len(strip.own) > first]
            rows = slice(first, min(first + block, len(strips[0].own)))
            own = np.empty((rows.stop - first, len(going), strips[0].own.shape[1]))
            elapsed = np.zeros((rows.stop - first, len(going)))
            for number, strip in enumerate(going):
                here = strip.own[rows]
                # Behind its end a strip is held, and no time passes.
                own[: len(here), number], own[len(here) :, number] = here, here[-1]
                elapsed[: len(here), number] = strip.elapsed_s[rows]
            columns = self.run_takes(states[: len(going)], elapsed, own, settings, shape)
            for number, strip in enumerate(going):
                some = slice(*np.searchsorted(strip.kept, [rows.start, rows.stop]).tolist())
                mine, at = strip.columns[some], as_slice(strip.kept[some] - rows.start)
                mine[:] = columns[at, number].reshape(mine.shape)


@dataclass(frozen=True)
class _Strip:
    """Frames without a gap, and where the columns of some are to be written."""

    own: np.ndarray
    """(N, L)."""
    elapsed_s: np.ndarray
    """(N,)."""
    kept: np.ndarray
    """(M,) rising: those frames."""
    columns: np.ndarray
    """(M, G, L, C)."""


def elapsed_s(time_s: np.ndarray) -> np.ndarray:
    """(N,) seconds since the frame before; 0 for the first one and after a gap."""
    elapsed = np.diff(time_s, prepend=time_s[:1])
    return np.where(elapsed > LONGEST_GAP_S, 0.0, elapsed)


def unbroken(time_s: np.ndarray) -> list[slice]:
    """The runs of frames between gaps."""
    breaks = np.flatnonzero(np.diff(time_s) > LONGEST_GAP_S) + 1
    edges = [0, *breaks.tolist(), len(time_s)]
    return [slice(start, end) for start, end in itertools.pairwise(edges)]


class _HistoryStream(Stream):
    def __init__(self, effect: HistoryEffect, settings: Settings, shape: np.ndarray) -> None:
        self._effect, self._settings, self._shape = effect, settings, shape
        self._state: Any = None
        self._last_s = 0.0

    def columns(self, frame: Signals) -> np.ndarray:
        time, own = float(frame.time_s[0]), frame.own[0]
        elapsed = time - self._last_s
        # A clock that was set back tells as little of what happened as a gap does.
        if self._state is None or not 0.0 <= elapsed <= LONGEST_GAP_S:
            self._state, elapsed = self._effect.start(own, self._settings, self._shape), 0.0
        self._last_s = time
        return self._effect.step(self._state, elapsed, own, self._settings, self._shape)[None]

    def reset(self) -> None:
        self._state = None

    @classmethod
    def together(cls, streams: Sequence[Any], frames: GloveFrames) -> np.ndarray:
        first = streams[0]
        effect, settings, shape = first._effect, first._settings, first._shape
        if not isinstance(effect, ArrayStateEffect):
            return super().together(streams, frames)
        states, elapsed, times = [], [], frames.time_s.tolist()
        for stream, time, own in zip(streams, times, frames.own, strict=True):
            state, passed = stream._state, time - stream._last_s
            if state is None or not 0.0 <= passed <= LONGEST_GAP_S:
                state, passed = effect.start(own, settings, shape), 0.0
            states.append(state)
            elapsed.append(passed)
        stacked = np.array(states)
        columns = effect.step(stacked, np.array(elapsed)[:, None, None], frames.own, settings, shape)
        for stream, time, state in zip(streams, times, stacked, strict=True):
            stream._state, stream._last_s = state, time
        return columns
