"""How many frames can have been lost between two that came: no more than a glove sends in the time between.

A sequence number that is further on was not lost on the way: it is made up, or its publisher jumped.
"""

from __future__ import annotations

MOST_FRAMES_PER_S = 1000
"""No glove sends more; of one that does, losses of several seconds in a row are taken for a jump."""
BURST_FRAMES = 1000
"""Lost in no time: messages that waited together arrive at once, and so do the frames around a loss."""

_FRAMES_PER_NS = MOST_FRAMES_PER_S / 1e9


class PlausibleLoss:
    """A token bucket of lost frames: it fills with time up to ``burst``, and a loss must be in it."""

    __slots__ = ("_at_ns", "_burst", "_spare")

    def __init__(self, at_ns: int, burst: int = BURST_FRAMES) -> None:
        self._burst = self._spare = float(burst)
        self._at_ns = at_ns

    def allows(self, lost: int, at_ns: int) -> bool:
        """Whether ``lost`` frames can have been lost since the last frame that was allowed.

        If so they are spent. ``at_ns``: when the frame after the loss came, by one clock for all calls.
        """
        spare = self._spare + max(0, at_ns - self._at_ns) * _FRAMES_PER_NS - lost
        if spare < 0:
            return False
        self._spare = min(self._burst, spare)
        self._at_ns = at_ns
        return True
