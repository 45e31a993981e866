"""An emulated CyberGlove III: its echoing command language, 61-byte records, battery, clock and card.

Written from the project's fact sheet (the vendor's manual and public drivers; no hardware was seen). What
the sheet calls unknown is chosen and marked here.
"""

from __future__ import annotations

import struct
from collections import deque

from glovecal_service.emulators.cyberglove import BITS
from glovecal_service.emulators.glove import Faults
from glovecal_service.emulators.hand import MovingHand, count_of_joint

FRAME_RATE = 30
CARD_GAP = 28
"""Bytes between the header's line feed and the first record, which nobody describes."""
_END = b"\r\n\0"
_WORDS = struct.Struct(">22H")
_UNKNOWN = b" e?\r\n\0"
_LENGTHS = dict.fromkeys((b"e", b"d", b"m", b"s", b"u", b"w", b"o"), 3) | {b"E": 9}
"""Of commands with the prefix 1, which counts too; the others have two bytes, or end with 0x01."""


class EmulatedCyberGlove3:
    """``dips``: False for a glove with 18 sensors, its four DIP words 0 (inferred). ``link``: u or w."""

    def __init__(
        self,
        hand: MovingHand | None = None,
        faults: Faults | None = None,
        *,
        dips: bool = True,
        link: str = "u",
        clock_s: float = 34200.0,
    ) -> None:
        self.hand = hand or MovingHand()
        self.faults = faults or Faults()
        self.sent: deque[tuple[int, ...]] = deque(maxlen=20000)
        """The words of every record streamed."""
        self.commands: list[bytes] = []
        self.card: dict[str, bytes] = {}
        self._dips = dips
        self._link = link
        self._set_clock_s = clock_s
        self.power_up()

    def power_up(self) -> None:
        self._began_s: float | None = None
        self._pending = b""
        self._streaming = False
        self._active: str | None = None
        self._wants_header = False
        self.destinations = {"u"}
        """The power-up state is not public: USB alone is chosen."""
        self.multiplier = 1
        self.dividers = {"s": 1, "u": 1, "w": 1}
        self._started_s, self._tick = 0.0, 0

    # ------------------------------------------------------------------ records
    def clock_s(self, now_s: float) -> float:
        """Second of the day by the glove's clock."""
        return (self._set_clock_s + self.faults.clock_s(now_s - (self._began_s or 0.0))) % 86400

    def words(self, time_s: float) -> list[int]:
        degrees = self.hand.degrees(time_s)
        words = []
        for bit in BITS[22]:
            missing = not self._dips and bit in (6, 10, 14, 18)
            words.append(0 if missing else max(1, min(4094, round(16 * count_of_joint(bit, degrees)))))
        return self.faults.values(words)

    def record(self, now_s: float) -> bytes:
        """HH:MM:SS:FF:nS, 22 words, CR LF NUL."""
        words = self.words(now_s - (self._began_s or 0.0))
        rate_hz = FRAME_RATE * self.multiplier
        ticks = int(self.clock_s(now_s) * rate_hz + 1e-5)
        second, sub_frames = divmod(ticks % (86400 * rate_hz), rate_hz)
        frame, sub_sample = divmod(sub_frames, self.multiplier)
        stamp = f"{second // 3600:02}:{second // 60 % 60:02}:{second % 60:02}:{frame:02}:{sub_sample}S"
        return stamp.encode() + _WORDS.pack(*words) + _END

    def due(self, now_s: float) -> bytes:
        if self._began_s is None:
            self._began_s = now_s
        out = b""
        while self._streaming and now_s >= self.next_due_s():
            whole = self.record(self.next_due_s())
            record = self.faults.record(whole)
            if "s" in self.destinations and self._active is not None:
                # What it does when no file is active is not public: it records nothing here.
                self.card[self._active] += record
            if self._link in self.destinations and self._tick % self.dividers[self._link] == 0:
                self.sent.append(_WORDS.unpack_from(whole, len(whole) - len(_END) - _WORDS.size))
                out += record
            self._tick += 1
        return out

    def next_due_s(self) -> float:
        if not self._streaming:
            return float("inf")
        rate_hz = FRAME_RATE * self.multiplier * (1 + self.faults.drift)
        return self._started_s + self._tick / rate_hz

    def _next_tick_s(self, now_s: float) -> float:
        """When its own clock next begins a sub-sample: one quartz drives clock and sampling (a choice)."""
        rate_hz = FRAME_RATE * self.multiplier
        ticks = self.clock_s(now_s) * rate_hz
        return now_s + (int(ticks) + 1 - ticks) / (rate_hz * (1 + self.faults.drift))

    # ------------------------------------------------------------------ commands
    def feed(self, data: bytes, now_s: float) -> bytes:
        if self._began_s is None:
            self._began_s = now_s
        out = b""
        for value in data:
            self._pending += bytes([value])
            if self._wants_header:
                if value == 1:
                    self.card[self._active or ""] = card_header(self._pending[:-1].decode("latin-1"))
                    self._pending, self._wants_header = b"", False
                    out += b"\0"
            elif self._complete(self._pending):
                command, self._pending = self._pending, b""
                self.commands.append(command)
                out += self._run(command, now_s)
        return out

    @staticmethod
    def _complete(command: bytes) -> bool:
        first, second = command[:1], command[1:2]
        if first == b"?":
            return len(command) == 2
        if first == b"!":
            return command != b"!" * len(command) or len(command) == 3
        if first == b"Z":
            return len(command) == 2
        if first != b"1":
            return True
        if second == b"t":
            return len(command) == (11 if command[2:3] == b"s" else 3)
        if second == b"A":
            return command.endswith(b"\x01")
        return bool(second) and len(command) == _LENGTHS.get(second, 2)

    def _run(self, command: bytes, now_s: float) -> bytes:
        if command in (b"\r", b"\n"):
            return b""
        if command in (b"\x03", b"!!!"):
            self._streaming = False
            return b"\x03\0"
        reply = self._reply(command, now_s)
        if reply is None:
            return _UNKNOWN
        return self.faults.echo(command, len(self.commands)) + reply

    def _reply(self, command: bytes, now_s: float) -> bytes | None:
        if command == b"V":
            volts = self.faults.battery_v(now_s - (self._began_s or now_s))
            return f"{round(1000 * volts)}Volts\r\n".encode()
        if command[:1] == b"?":
            return self._query(command[1:2])
        if command == b"i":
            return b"CyberGlove III (emulated, simulated motion)" + _END
        if command[:1] == b"Z":
            return b"\0"
        if command[:1] == b"1":
            return self._level_one(command[1:], now_s)
        return None

    def _query(self, letter: bytes) -> bytes | None:
        if letter == b"A":
            return (self._active or "").encode() + b"\0"
        if letter == b"I":
            used = sum(map(len, self.card.values())) // 1_000_000
            return f"\r\n2000MB disk\r\n{2000 - used}MB left\r\n".encode() + b"\0"
        if letter == b"l":
            return "".join(f"{name}\r\n" for name in self.card).encode() + b"\0"
        if letter == b"T":
            return bytes(4) + b"\0"
        return {b"G": b"\x03\0", b"S": bytes([22 if self._dips else 18, 0]), b"R": b"\x01\0"}.get(letter)

    def _level_one(self, command: bytes, now_s: float) -> bytes | None:
        letter, rest = command[:1].decode("latin-1"), command[1:]
        if letter in "ed" and rest in (b"w", b"u", b"s"):
            (self.destinations.add if letter == "e" else self.destinations.discard)(rest.decode())
            return b"\0"
        if letter == "m" and 1 <= rest[0] <= 4:
            self.multiplier = rest[0]
            return b"\0"
        if letter in "suw" and rest and rest[0]:
            self.dividers[letter] = rest[0]
            return b"\0"
        if letter == "o":
            return b"\0"
        if letter == "E" and rest.isdigit() and rest[0] in b"1234":
            self.multiplier = int(rest[:1])
            wanted = zip("suw", rest[1:4], strict=True)
            self.destinations = {name for name, on in wanted if on == ord("1")}
            return b"\0"
        if letter == "t":
            return self._clock(rest, now_s)
        if letter == "A":
            return self._open_file(rest[:-1].decode("latin-1"))
        if letter == "D" and self._active is not None:
            return self.card[self._active]
        if letter == "G":
            return self.record(now_s)
        if letter == "S":
            self._streaming, self._started_s, self._tick = True, self._next_tick_s(now_s), 0
            return b""
        return None

    def _clock(self, rest: bytes, now_s: float) -> bytes | None:
        if rest[:1] == b"g":
            clock_s = self.clock_s(now_s)
            second, frame = int(clock_s), int(clock_s % 1 * FRAME_RATE)
            return f"{second // 3600:02}:{second // 60 % 60:02}:{second % 60:02}:{frame:02}".encode()
        try:
            hour, minute, second = (int(part) for part in rest[1:].split(b":"))
        except ValueError:
            return None
        self._set_clock_s += 3600 * hour + 60 * minute + second - self.clock_s(now_s)
        return b"\0"

    def _open_file(self, name: str) -> bytes:
        """An existing file answers 0x01, a new one 0x00 and then takes the header's text up to 0x01."""
        self._active = name
        if name in self.card:
            return b"\x01"
        self._wants_header = True
        return b"\0"


def card_header(text: str) -> bytes:
    """Header text, line feed, and 28 bytes whose content is not public."""
    return text.encode() + b"\n" + bytes(range(0x80, 0x80 + CARD_GAP))


def card_file(text: str, records: list[bytes]) -> bytes:
    """A file as it lies on the card: header, records, and a trailer with a time-like start."""
    return card_header(text) + b"".join(records) + b"00 " + bytes(64)
