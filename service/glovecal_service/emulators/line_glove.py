"""An emulated home-made glove that sends lines with a checksum, and the description that reads them."""

from __future__ import annotations

from functools import reduce
from operator import xor

from glovecal_service.emulators.glove import SendingGlove

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
_JOINTS = ("T_IP", "I_PIP", "M_PIP", "R_PIP", "P_PIP")
_REST, _SPAN = 120, 760


class EmulatedLineGlove(SendingGlove):
    """Five flex sensors on a 10-bit converter, 50 lines a second."""

    rate_hz = 50.0

    def values(self, time_s: float) -> list[int]:
        bent = self.hand.bent(time_s)
        return [_REST + round(_SPAN * bent[joint]) for joint in _JOINTS]

    def record(self, values: list[int], time_s: float) -> bytes:
        milliseconds = int(self.faults.clock_s(time_s) * 1000) & 0xFFFFFFFF
        millivolts = round(1000 * self.faults.battery_v(time_s))
        body = ",".join(map(str, (milliseconds, *values, millivolts)))
        return f"${body}*{reduce(xor, body.encode()):02X}\r\n".encode()
