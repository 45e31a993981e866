"""How often somebody may: so many at once, then one after each pause."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable

from glovecal_service.rest.http.problem import Problem

MOST_REMEMBERED = 10_000


class Pauses:
    """By whom, when what they did would be forgotten; the oldest go first where there are too many."""

    def __init__(self, pause_s: float, at_once: int, clock: Callable[[], float]) -> None:
        """``at_once``: before the first pause; ``clock`` tells seconds."""
        self._pause_s, self._at_once = pause_s, at_once
        self._clock = clock
        self._free_at: OrderedDict[str, float] = OrderedDict()

    def wait_s(self, who: str) -> float:
        """How long until one more is let through; 0: now."""
        ahead = self._free_at.get(who, 0.0) - self._clock()
        return max(0.0, ahead - (self._at_once - 1) * self._pause_s)

    def count(self, who: str) -> None:
        self._free_at[who] = max(self._free_at.get(who, 0.0), self._clock()) + self._pause_s
        self._free_at.move_to_end(who)
        if len(self._free_at) > MOST_REMEMBERED:
            self._free_at.popitem(last=False)

    def take_back(self, who: str) -> None:
        if who in self._free_at:
            self._free_at[who] -= self._pause_s


def too_early(wait_s: float, kind: str, sentence: str) -> Problem:
    """429 for who comes ``wait_s`` too early; ``{seconds}`` in the sentence is how long to wait."""
    seconds = math.ceil(wait_s)
    return Problem(
        429, kind, sentence.replace("{seconds}", str(seconds)), headers={"Retry-After": str(seconds)}
    )
