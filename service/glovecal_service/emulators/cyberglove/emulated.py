"""The emulated control box with the simulated hand in its glove, and with faults."""

from __future__ import annotations

from glovecal_service.emulators.cyberglove.box import EmulatedBox
from glovecal_service.emulators.cyberglove.counts import counts_of_hand
from glovecal_service.emulators.faults import Faults
from glovecal_service.emulators.hand import MovingHand


class EmulatedCyberGlove(EmulatedBox):
    """A box whose sensors follow the hand; sample records alone suffer from noise and cuts."""

    def __init__(
        self, hand: MovingHand | None = None, faults: Faults | None = None, *, sensors: int = 18
    ) -> None:
        self._hand = hand or MovingHand()
        self._faults = faults or Faults()
        self._began_s: float | None = None
        super().__init__(sensors, motion=self._counts)

    def power_up(self) -> None:
        self._power_up()

    def values(self, now_s: float) -> list[int]:
        return self._faults.values(super().values(now_s))

    def timestamp(self, now_s: float) -> bytes:
        return super().timestamp(self._faults.clock_s(now_s))

    def record(self, head: str, now_s: float) -> bytes:
        record = super().record(head, now_s)
        if len(self.records) > 20000:
            del self.records[:10000], self.times[:10000]
        return self._faults.record(record)

    def _counts(self, now_s: float) -> dict[int, int]:
        if self._began_s is None:
            self._began_s = now_s
        return counts_of_hand(self._hand.degrees(now_s - self._began_s))
