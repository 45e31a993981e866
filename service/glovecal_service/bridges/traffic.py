"""What went through a bridge, counted and timed: by glove, since the start and since the last look."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from glovecal_client.clock import clock_ns
from glovecal_client.pose_subscriber import PoseCounts
from glovecal_service.bridges.glove_pose import GlovePose, PoseState

_MOST_DELAYS = 72_000
"""Five minutes of two gloves at 120 Hz."""


@dataclass
class GloveTraffic:
    """Counts of one glove."""

    counts: Callable[[], PoseCounts]
    state: PoseState | None = None
    """Of the last pose that was handled; None before the first."""
    taken: int = 0
    """Poses that the bridge had its hands on."""
    departed: int = 0
    """Live poses that left; with several receivers, each time."""
    left_out: int = 0
    """Poses that a receiver did not take in time: it got newer ones, or nothing could be sent."""
    reconnects: int = 0
    """Times that poses came again after they had been stale."""

    def document(self) -> dict[str, Any]:
        """``lost``: between glove and bridge; ``overtaken``: newer ones came before the bridge took them."""
        counts = self.counts()
        return {
            "state": self.state,
            "received": counts.received,
            "lost": counts.lost + counts.damaged,
            "overtaken": max(0, counts.received - self.taken),
            "sent": self.departed,
            "left_out": self.left_out,
            "reconnects": self.reconnects,
        }


@dataclass
class _Delays:
    """Milliseconds from a pose's arrival here, and from the hand's time, to its departure."""

    added_ms: deque[float] = field(default_factory=lambda: deque(maxlen=_MOST_DELAYS))
    finger_ms: deque[float] = field(default_factory=lambda: deque(maxlen=_MOST_DELAYS))

    def document(self) -> dict[str, Any]:
        return {"added_ms": _percentiles(self.added_ms), "finger_to_wire_ms": _percentiles(self.finger_ms)}


def _percentiles(values: deque[float]) -> dict[str, float] | None:
    if not values:
        return None
    p50, p99 = np.percentile(np.array(values), [50, 99]).round(3).tolist()
    return {"p50": p50, "p99": p99}


class Traffic:
    """For several threads: gloves' own, and those of receivers."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._gloves: dict[str, GloveTraffic] = {}
        self._whole, self._recent = _Delays(), _Delays()
        self._received: dict[str, int] = {}
        self._looked_ns = clock_ns()

    def add_glove(self, glove: str, counts: Callable[[], PoseCounts]) -> None:
        with self._lock:
            self._gloves[glove] = GloveTraffic(counts)

    def note_taken(self, hand: GlovePose, *, is_new: bool) -> None:
        """The bridge has a pose, or (not ``is_new``) finds its last one stale."""
        with self._lock:
            glove = self._gloves[hand.glove]
            glove.taken += is_new
            glove.reconnects += glove.state == "stale" and hand.state != "stale"
            glove.state = hand.state

    def note_departure(self, hand: GlovePose) -> None:
        """A pose has left for a receiver, now. Only live ones are counted and timed."""
        if hand.state != "live":
            return
        now_ns = clock_ns()
        with self._lock:
            self._gloves[hand.glove].departed += 1
            for delays in (self._whole, self._recent):
                delays.added_ms.append((now_ns - hand.arrived_ns) / 1e6)
                if hand.is_of_this_computer:
                    delays.finger_ms.append((now_ns - hand.pose.monotonic_ns) / 1e6)

    def note_left_out(self, glove: str, count: int = 1) -> None:
        """A receiver did not get so many poses."""
        with self._lock:
            self._gloves[glove].left_out += count

    def document(self) -> dict[str, Any]:
        """Counts and delays since the start."""
        with self._lock:
            gloves = {name: glove.document() for name, glove in self._gloves.items()}
            return {"gloves": gloves, **self._whole.document()}

    def recent(self) -> dict[str, Any]:
        """As ``document``, with delays and rates (poses a second) since it was last asked for."""
        with self._lock:
            seconds, self._looked_ns = (clock_ns() - self._looked_ns) / 1e9, clock_ns()
            gloves = {}
            for name, glove in self._gloves.items():
                document = glove.document()
                new = document["received"] - self._received.get(name, 0)
                self._received[name] = document["received"]
                gloves[name] = {"rate_hz": round(new / max(seconds, 1e-3), 1), **document}
            delays, self._recent = self._recent, _Delays()
            return {"gloves": gloves, **delays.document()}
