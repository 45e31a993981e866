"""Emulated gloves that send lines of text: LeRobot's Homunculus, LucidGloves, and a home-made one.

The Homunculus sends sixteen numbers with blanks between them, one line a sample. A LucidGlove sends alpha or
legacy lines, in lock-step with the computer as the firmware is. The home-made one has a checksum, and the
description that reads its lines.
"""

from __future__ import annotations

from functools import reduce
from operator import xor

from glovecal_service.emulators.glove import Faults, SendingGlove
from glovecal_service.emulators.hand import MovingHand

_DRIVEN_BY = (
    "T_TMC", "T_MCP", "T_IP", "T_IP",
    "IM_ABD", "I_MCP", "I_PIP", "IM_ABD", "M_MCP", "M_PIP",
    "MR_ABD", "R_MCP", "R_PIP", "RP_ABD", "P_MCP", "P_PIP",
)  # fmt: skip
_LOW, _SPAN = 1450, 1700
"""The documents show counts from about 1450 to 3150."""


class EmulatedHomunculus(SendingGlove):
    """At 140 lines a second; real ones send 120 to 165."""

    rate_hz = 140.0

    def values(self, time_s: float) -> list[int]:
        bent = self.hand.bent(time_s)
        return [_LOW + round(_SPAN * bent[joint]) for joint in _DRIVEN_BY]

    def record(self, values: list[int], time_s: float) -> bytes:
        return " ".join(map(str, values)).encode() + b"\n"


DESCRIPTION = """\
name = "lucidglove"               # the layout whose sensors it has
rate_hz = 50

[line]                            # $MS,T,I,M,R,P,MILLIVOLT*CHECKSUM
start = "$"
separator = ","
columns = ["ms", "T_FLEX", "I_FLEX", "M_FLEX", "R_FLEX", "P_FLEX", "battery"]

[values]
lowest = 0
highest = 1023
unit = "counts"

[checksum]
kind = "xor"                      # of what lies between the start and the separator
separator = "*"
digits = "hex"

[time]
column = "ms"
unit = "ms"

[context]
supply_v = { column = "battery", factor = 0.001 }
"""
_LINE_JOINTS = ("T_IP", "I_PIP", "M_PIP", "R_PIP", "P_PIP")
_REST, _LINE_SPAN = 120, 760


class EmulatedLineGlove(SendingGlove):
    """Five flex sensors on a 10-bit converter, 50 lines a second."""

    rate_hz = 50.0

    def values(self, time_s: float) -> list[int]:
        bent = self.hand.bent(time_s)
        return [_REST + round(_LINE_SPAN * bent[joint]) for joint in _LINE_JOINTS]

    def record(self, values: list[int], time_s: float) -> bytes:
        milliseconds = int(self.faults.clock_s(time_s) * 1000) & 0xFFFFFFFF
        millivolts = round(1000 * self.faults.battery_v(time_s))
        body = ",".join(map(str, (milliseconds, *values, millivolts)))
        return f"${body}*{reduce(xor, body.encode()):02X}\r\n".encode()


MAX = 4095
LINE_TIMEOUT_S = 1.0
_JOINTS = (
    ("T_MCP", "T_IP"), ("I_MCP", "I_PIP"), ("M_MCP", "M_PIP"), ("R_MCP", "R_PIP"), ("P_MCP", "P_PIP"),
)  # fmt: skip
_POT_LOW, _POT_SPAN = 310, 2900
"""Counts of the bare potentiometers, before the firmware scales them; chosen, not measured."""


class EmulatedLucidGlove(SendingGlove):
    """``legacy``: the older encoding. ``splay``: the optional fields behind the flags."""

    rate_hz = 100.0

    def __init__(
        self,
        hand: MovingHand | None = None,
        faults: Faults | None = None,
        *,
        legacy: bool = False,
        splay: bool = False,
    ) -> None:
        super().__init__(hand, faults)
        self._legacy = legacy
        self._splay = splay
        self.power_up()

    def power_up(self) -> None:
        super().power_up()
        self._least, self._most = [10**6] * 5, [-1] * 5
        self._lines_heard = 0
        self._next_s = float("-inf")
        self._waits_until_s = float("-inf")

    def feed(self, data: bytes, now_s: float) -> bytes:
        """Servo and vibration commands move nothing here; each line feed lets the loop go on."""
        self._lines_heard += data.count(b"\n")
        return b""

    def due(self, now_s: float) -> bytes:
        """At most one line: the loop sends, then waits."""
        if self._began_s is None:
            self._began_s = now_s
        if now_s < self._next_s or (not self._lines_heard and now_s < self._waits_until_s):
            return b""
        self._lines_heard = max(0, self._lines_heard - 1)
        self._next_s = now_s + 1 / self.rate_hz
        self._waits_until_s = now_s + LINE_TIMEOUT_S
        return self.next_record(now_s - self._began_s)

    def next_due_s(self) -> float:
        return self._next_s if self._lines_heard else max(self._next_s, self._waits_until_s)

    def values(self, time_s: float) -> list[int]:
        bent = self.hand.bent(time_s)
        scaled = []
        for finger, joints in enumerate(_JOINTS):
            pot = _POT_LOW + round(_POT_SPAN * sum(bent[joint] for joint in joints) / len(joints))
            least = self._least[finger] = min(pot, self._least[finger])
            most = self._most[finger] = max(pot, self._most[finger])
            scaled.append(MAX // 2 if least == most else (pot - least) * MAX // (most - least))
        return scaled

    def record(self, values: list[int], time_s: float) -> bytes:
        thumb, index, *others = values
        half = MAX // 2
        trigger = 0 if index < half else 2 * (index - half)  # up to one more than MAX, as in the firmware
        pulls, pinches = index > half, (index + thumb) / 2 > half
        grabs = (index + sum(others)) / 4 > half
        if self._legacy:
            fields = [*values, half, half, 0, int(pulls), 0, 0, int(grabs), int(pinches)]
            return "&".join(map(str, fields)).encode() + b"\n"
        line = "".join(f"{key}{value}" for key, value in zip("ABCDE", values, strict=True))
        line += f"F{half}G{half}P{trigger}" + "I" * pulls + "L" * grabs + "M" * pinches
        if self._splay:
            line += "".join(f"({finger}B){half}" for finger in "ABCDE")
        return line.encode() + b"\n"
