"""An emulated LeRobot Homunculus glove: sixteen numbers with blanks between them, one line a sample."""

from __future__ import annotations

from glovecal_service.emulators.glove import SendingGlove

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
