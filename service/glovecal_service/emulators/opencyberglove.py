"""An emulated OpenCyberGlove: packets of 132 bytes, begun in the middle, as when a port is opened at any
time."""

from __future__ import annotations

import random
import struct
import zlib

from glovecal_service.emulators.glove import Faults, SendingGlove
from glovecal_service.emulators.hand import MovingHand

RANGE = 16384
_DRIVEN_BY = (
    "T_IP", "T_MCP", "TI_ABD", "T_TMC", "I_MCP", "I_PIP", "I_DIP", "IM_ABD", "M_MCP", "M_PIP",
    "M_DIP", "MR_ABD", "R_MCP", "R_PIP", "R_DIP", "RP_ABD", "P_MCP", "P_PIP", "P_DIP",
)  # fmt: skip
"""Which joint stretches which sensor, in the order that its makers publish."""
_REST, _SPAN = 3000, 9000
"""Counts of a straight and of a fully bent joint; chosen, not measured."""


class EmulatedOpenCyberGlove(SendingGlove):
    """``seed`` fixes where it begins and the eight bytes that nothing describes."""

    rate_hz = 120.0

    def __init__(
        self, hand: MovingHand | None = None, faults: Faults | None = None, *, seed: int = 0
    ) -> None:
        super().__init__(hand, faults)
        self._chance = random.Random(seed)
        self._begun = False

    def power_up(self) -> None:
        super().power_up()
        self._begun = False

    def values(self, time_s: float) -> list[int]:
        bent = self.hand.bent(time_s)
        return [min(RANGE, _REST + round(_SPAN * bent[joint])) for joint in _DRIVEN_BY]

    def record(self, values: list[int], time_s: float) -> bytes:
        ticks = int(self.faults.clock_s(time_s) * 1e6) & 0xFFFFFFFF
        still = (0.0, 0.0, 9.81, 0.0, 0.0, 0.0, 22.0, 5.0, -41.0)
        covered = struct.pack("<19i9ffI", *values, *still, 31.5, ticks)
        return covered + self._chance.randbytes(8) + struct.pack("<I", zlib.crc32(covered))

    def next_record(self, time_s: float) -> bytes:
        record = super().next_record(time_s)
        if not self._begun:
            self._begun = True
            self.sent.pop()
            return record[self._chance.randrange(1, len(record)) :]
        return record
