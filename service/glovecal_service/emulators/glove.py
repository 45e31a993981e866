"""Faults that can be switched on in an emulated glove, by name.

What an emulated glove is: bytes in, bytes out, by a clock that is given with every call.
"""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Collection, Sequence
from typing import Protocol

from glovecal_service.emulators.hand import MovingHand

EVERY_GLOVE = {
    "unplug": "the link is gone for 1 s, every 5 s",
    "stuck-sensor": "the second sensor stays where it was",
    "noise": "random bytes between 5 % of the records",
    "short-records": "5 % of the records end early",
}
WITH_CLOCK = {
    "clock-offset": "the glove's clock is 100 s ahead",
    "clock-drift": "the glove's clock gains 100 ppm",
}
WITH_BATTERY = {"battery": "the battery falls from 8.2 to 6.2 V in ten minutes"}
WITH_ECHO = {"dropped-echo": "every second echo loses its first byte"}
WITH_FRAGMENTS = {"fragments": "the last two bytes of a time stamp stand alone before 5 % of the records"}
EXPLAINED = EVERY_GLOVE | WITH_CLOCK | WITH_BATTERY | WITH_ECHO | WITH_FRAGMENTS

OFFSET_S = 100.0
DRIFT = 100e-6
UNPLUGGED_S, PERIOD_S = 1.0, 5.0
_SHARE = 0.05
_FULL_V, _USUAL_V, _EMPTY_V, _LASTS_S = 8.2, 7.445, 6.2, 600.0


class Faults:
    """The faults of ``names``, and what each does. ``seed`` fixes where the random ones strike."""

    def __init__(self, names: Collection[str] = (), seed: int = 0) -> None:
        self.names = set(names)
        self.drift = DRIFT if "clock-drift" in self.names else 0.0
        """What the glove's clock gains, s per s; another may be put here."""
        self.offset_s = OFFSET_S if "clock-offset" in self.names else 0.0
        self._chance = random.Random(seed)
        self._stuck_at: float | None = None

    def values(self, values: Sequence[int]) -> list[int]:
        """With ``stuck-sensor`` the second value is what it was at first."""
        changed = list(values)
        if "stuck-sensor" in self.names:
            if self._stuck_at is None:
                self._stuck_at = changed[1]
            changed[1] = int(self._stuck_at)
        return changed

    def record(self, record: bytes) -> bytes:
        """A record on its way out: cut short, or with noise before it."""
        if "short-records" in self.names and self._chance.random() < _SHARE:
            record = record[: self._chance.randrange(1, len(record))]
        if "fragments" in self.names and self._chance.random() < _SHARE:
            record = b"1S" + record
        if "noise" in self.names and self._chance.random() < _SHARE:
            record = self._chance.randbytes(self._chance.randint(1, 40)) + record
        return record

    def clock_s(self, time_s: float) -> float:
        """What the glove's clock says at ``time_s``."""
        return time_s * (1 + self.drift) + self.offset_s

    def battery_v(self, on_for_s: float) -> float:
        """Volts after so many seconds of use."""
        if "battery" not in self.names:
            return _USUAL_V
        return max(_EMPTY_V, _FULL_V - (_FULL_V - _EMPTY_V) * on_for_s / _LASTS_S)

    def echo(self, echo: bytes, number: int) -> bytes:
        """The echo of the ``number``-th command."""
        return echo[1:] if "dropped-echo" in self.names and number % 2 else echo

    def unplugged(self, on_for_s: float) -> bool:
        """Whether the link is gone after so many seconds."""
        return "unplug" in self.names and on_for_s % PERIOD_S > PERIOD_S - UNPLUGGED_S


_REMEMBERED = 20000


class EmulatedGlove(Protocol):
    """``now_s`` is any steadily growing clock; the glove's own begins at the first call after power-up."""

    def power_up(self) -> None:
        """Forget everything said so far, as after its cable was pulled."""
        ...

    def feed(self, data: bytes, now_s: float) -> bytes:
        """Bytes from the computer; returns the replies."""
        ...

    def due(self, now_s: float) -> bytes:
        """Everything that it sends by itself up to now."""
        ...

    def next_due_s(self) -> float:
        """When to call ``due`` again at the latest."""
        ...


class SendingGlove:
    """Base of gloves that send ``record`` after ``record`` from power-up on, and listen to nothing."""

    rate_hz = 60.0

    def __init__(self, hand: MovingHand | None = None, faults: Faults | None = None) -> None:
        self.hand = hand or MovingHand()
        self.faults = faults or Faults()
        self.sent: deque[tuple[int, ...]] = deque(maxlen=_REMEMBERED)
        """The sensor values of every record, in the order of the wire, before any damage to the record."""
        self._began_s: float | None = None
        self._number = 0

    def values(self, time_s: float) -> list[int]:
        """Sensor values on the wire, ``time_s`` after power-up."""
        raise NotImplementedError

    def record(self, values: list[int], time_s: float) -> bytes:
        """The bytes of one record."""
        raise NotImplementedError

    def power_up(self) -> None:
        self._began_s = None
        self._number = 0

    def feed(self, data: bytes, now_s: float) -> bytes:
        return b""

    def due(self, now_s: float) -> bytes:
        if self._began_s is None:
            self._began_s = now_s
        out = b""
        while now_s >= self._began_s + self._number / self.rate_hz:
            out += self.next_record(self._number / self.rate_hz)
            self._number += 1
        return out

    def next_record(self, time_s: float) -> bytes:
        """The record for ``time_s``, remembered, with its faults."""
        values = self.faults.values(self.values(time_s))
        self.sent.append(tuple(values))
        return self.faults.record(self.record(values, time_s))

    def next_due_s(self) -> float:
        return float("-inf") if self._began_s is None else self._began_s + self._number / self.rate_hz
