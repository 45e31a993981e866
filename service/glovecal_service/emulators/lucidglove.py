"""An emulated LucidGlove: alpha or legacy lines, in lock-step with the computer as the firmware is.

After each line it waits for a line from the computer, at most Arduino's default second (inferred from the
firmware). Flexion is scaled by the smallest and largest value since power-up, so the scale creeps.
"""

from __future__ import annotations

from glovecal_service.emulators.faults import Faults
from glovecal_service.emulators.glove import SendingGlove
from glovecal_service.emulators.hand import MovingHand

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
