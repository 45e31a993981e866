"""How many messages of a glove are looked into: more than it can send cost nobody anything."""

from __future__ import annotations

MOST_HZ = 2000.0
"""Of a glove that did not say how fast it is."""
TIMES_DECLARED = 4.0
FEWEST_HZ = 400.0
"""However slow a glove says it is."""
BURST = 1000
"""Messages that waited together arrive at once."""


class RateLimit:
    """A token bucket: it fills with time up to ``BURST``, and each message takes one. For one thread."""

    __slots__ = ("_at_ns", "_per_ns", "_spare")

    def __init__(self) -> None:
        self._spare = float(BURST)
        self._at_ns = 0
        self._per_ns = MOST_HZ / 1e9

    def declare(self, rate_hz: float | None) -> None:
        """Take note of the glove's own rate, frames a second; None where it is not known."""
        most_hz = MOST_HZ if rate_hz is None else min(max(TIMES_DECLARED * rate_hz, FEWEST_HZ), MOST_HZ)
        self._per_ns = most_hz / 1e9

    def allows(self, at_ns: int) -> bool:
        """Whether a message that came at ``at_ns`` is looked into."""
        spare = min(float(BURST), self._spare + max(0, at_ns - self._at_ns) * self._per_ns)
        self._at_ns = max(at_ns, self._at_ns)
        if spare < 1.0:
            self._spare = spare
            return False
        self._spare = spare - 1.0
        return True
