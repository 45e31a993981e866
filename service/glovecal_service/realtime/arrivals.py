"""Messages from zenoh's receive thread to one of ours, without ever making zenoh wait.

A callback that blocks, or a FIFO channel that fills, stalls everything else on its link; a ring channel
drops without counting. So the callback is direct and does three things only: copy the bytes out, note the
time, put both into a queue.
"""

from __future__ import annotations

import time
from queue import Empty, SimpleQueue
from threading import Lock
from typing import NamedTuple

import zenoh

ARRIVALS_LIMIT = 8192
"""Messages waiting at most; at 16 gloves and 120 Hz that is four seconds of a reader that stands still."""


class Arrival(NamedTuple):
    """One message as it came."""

    key: str
    payload: bytes
    received_ns: int
    """``time.monotonic_ns()`` of this process when zenoh handed the message over."""


class Arrivals:
    """A subscription whose messages wait here until ``wait`` or ``drain`` takes them."""

    def __init__(self, session: zenoh.Session, key_expression: str, *, limit: int = ARRIVALS_LIMIT) -> None:
        self._queue: SimpleQueue[Arrival] = SimpleQueue()
        self._limit = limit
        self._lock = Lock()
        self._refused: dict[str, int] = {}
        self._subscriber = session.declare_subscriber(
            key_expression, zenoh.handlers.Callback(self._receive, indirect=False)
        )

    def _receive(self, sample: zenoh.Sample) -> None:
        if self._queue.qsize() < self._limit:
            self._queue.put(Arrival(str(sample.key_expr), sample.payload.to_bytes(), time.monotonic_ns()))
            return
        with self._lock:
            key = str(sample.key_expr)
            self._refused[key] = self._refused.get(key, 0) + 1

    def wait(self, timeout_s: float) -> Arrival | None:
        """The next message, or None when none came in time."""
        try:
            return self._queue.get(timeout=timeout_s)
        except Empty:
            return None

    def drain(self) -> list[Arrival]:
        """All messages that are waiting, oldest first; does not wait. For one reading thread only."""
        return [self._queue.get_nowait() for _ in range(self._queue.qsize())]

    def take_refused(self) -> dict[str, int]:
        """Messages thrown away since the last call because the reader stood still, by key."""
        if not self._refused:
            return {}
        with self._lock:
            refused, self._refused = self._refused, {}
        return refused

    def close(self) -> None:
        """Stop receiving; what waits can still be drained."""
        self._subscriber.undeclare()
