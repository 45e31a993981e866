"""Effects with a memory: a recursion over frames, the same for a whole take and for a live stream."""

from __future__ import annotations

import itertools
from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from glovecal_models.effects.base.effect import Effect, Stream
from glovecal_models.effects.base.facts import Settings
from glovecal_models.effects.base.signals import GloveFrames, Signals

LONGEST_GAP_S = 1.0
"""After a longer pause the state is forgotten: the hand may have done anything meanwhile."""
BLOCK_FRAMES = 256
"""So many frames are prepared at once: enough to be quick, few enough to stay in the processor's cache."""


class HistoryEffect(Effect):
    """Implement ``start`` and ``step``; batch and stream follow, equal to the last bit and causal."""

    has_memory: ClassVar[bool] = True

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
        result = np.empty((frames, take.own.shape[1], len(self.weight_names(settings))))
        for part in unbroken(take.time_s):
            state = self.start(take.own[part.start], settings, shape)
            for first in range(part.start, part.stop, BLOCK_FRAMES):
                block = slice(first, min(first + BLOCK_FRAMES, part.stop))
                result[block] = self.run(state, elapsed[block], take.own[block], settings, shape)
        return result

    def forward_weights(self, settings: Settings, generator: np.random.Generator) -> np.ndarray:
        """All of one sign: parts of one memory do not undo each other."""
        sign = generator.choice([-1.0, 1.0])
        return sign * np.abs(super().forward_weights(settings, generator))

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
