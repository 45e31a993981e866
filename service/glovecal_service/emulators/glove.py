"""What an emulated glove is: bytes in, bytes out, by a clock that is given with every call."""

from __future__ import annotations

from collections import deque
from typing import Protocol

from glovecal_service.emulators.faults import Faults
from glovecal_service.emulators.hand import MovingHand

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
