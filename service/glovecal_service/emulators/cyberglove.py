"""An emulated CyberGlove I/II control box: the command language, byte by byte, without any port.

Written from a fact sheet of public sources and drivers (no hardware was seen), and on purpose without
importing a line of the driver it tests. Where sources disagree or are silent, the choice is marked.

The emulated control box with the simulated hand in its glove, and with faults.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from glovecal_service.emulators.glove import Faults
from glovecal_service.emulators.hand import MovingHand, counts_at, counts_of_hand

TICKS_PER_SECOND = 115200
HARDWARE_MASK = {18: 0x7BBB3F, 22: 0x7FFF7F}
BITS = {count: [bit for bit in range(24) if mask >> bit & 1] for count, mask in HARDWARE_MASK.items()}
UNKNOWN = b"e?\0"
BAD_NUMBERS = b"en\0"
TEXT_END = b"\r\n\0"

# letter -> length of its binary payload; G, S, C, A and E are handled by themselves.
PAYLOAD = {b"B": 1, b"M": 3, b"N": 1, b"P": 3, b"T": 4} | {
    bytes([letter]): 1 for letter in b"DUFJLWQY"
}  # fmt: skip
FLAGS = b"DUFJLWQY"


@dataclass
class Settings:
    """What the commands change. Power-up: filter on, switch controls the light, status and time stamp off."""

    mask: int = 0xFFFFFF
    number: int = 22
    words: tuple[int, int] = (1152, 1)
    baud_byte: int = 0
    flags: dict[str, bool] = field(
        default_factory=lambda: dict.fromkeys("DUFJLWQY", False) | {"F": True, "J": True}
    )
    ascii_sync: bool = False


class EmulatedBox:
    """Bytes in, bytes out. ``now_s`` is any steadily growing clock, given with every call."""

    def __init__(
        self,
        sensors: int = 18,
        *,
        right_hand: bool = True,
        baud: int = 115200,
        restart_silence_s: float = 1.75,
        motion: Callable[[float], dict[int, int]] = counts_at,
    ) -> None:
        self.sensors = sensors
        self.right_hand = right_hand
        self.power_up_baud = baud
        self.restart_silence_s = restart_silence_s
        self.motion = motion
        self.glove_plugged = True
        self.stuck = False
        """Deaf to everything but a restart, as a box whose firmware hangs."""
        self.eeprom = bytearray(256)
        self.offsets = bytearray([127] * sensors)
        self.gains = bytearray([200] * sensors)
        self.actuators = bytearray(6)
        self.commands: list[bytes] = []
        """Every complete command, as it came."""
        self.records: list[bytes] = []
        """Every sample record sent, before any damage on the way."""
        self.times: list[float] = []
        """When each was sent, by the clock of the caller."""
        self._power_up()

    def _power_up(self) -> None:
        self.settings = Settings(number=self.sensors)
        self.baud = self.power_up_baud
        self.streaming: str | None = None
        self.deaf_until_s = float("-inf")
        self._later = b""
        self._pending = b""
        self._next_sample_s = 0.0

    # ------------------------------------------------------------------ samples
    @property
    def bits(self) -> list[int]:
        """The sensors sent: hardware mask AND software mask, of these the first N."""
        kept = [bit for bit in BITS[self.sensors] if self.settings.mask >> bit & 1]
        return kept[: self.settings.number]

    @property
    def record_bytes(self) -> int:
        flags = self.settings.flags
        return 1 + len(self.bits) + 5 * flags["D"] + flags["U"] + 1

    @property
    def wire_period_s(self) -> float:
        return self.record_bytes * 10 / self.baud

    @property
    def asked_period_s(self) -> float:
        """w1 * w2 / 115200 s; a word of 0 means as fast as possible."""
        first, second = self.settings.words
        return first * second / TICKS_PER_SECOND

    @property
    def too_fast(self) -> bool:
        return 0 < self.asked_period_s < self.wire_period_s

    def status_byte(self) -> int:
        flags = self.settings.flags
        return 0x80 | self.glove_plugged | flags["W"] << 1 | flags["L"] << 2

    def timestamp(self, now_s: float) -> bytes:
        """Flag byte 1xxxDCBA, then 4 bytes, the lowest first; a zero travels as 1 with its flag set."""
        ticks = int(now_s * TICKS_PER_SECOND) & 0xFFFFFFFF
        flag, data = 0x80, bytearray(ticks.to_bytes(4, "little"))
        for index, byte in enumerate(data):
            if byte == 0:
                flag |= 1 << index
                data[index] = 1
        return bytes([flag]) + bytes(data)

    def values(self, now_s: float) -> list[int]:
        # Two drivers read a 0 as "not connected"; that an unplugged glove sends zeros is inferred from them.
        if not self.glove_plugged:
            return [0] * len(self.bits)
        counts = self.motion(now_s)
        return [counts[bit] for bit in self.bits]

    def record(self, head: str, now_s: float) -> bytes:
        """head, sensors, [time stamp], [status], [error pairs], NUL."""
        flags = self.settings.flags
        errors = (b"es" if self.streaming and self.too_fast else b"") + (b"" if self.glove_plugged else b"eg")
        if head.islower():
            text = "".join(f"{value:4d}" for value in self.values(now_s))
            record = head.encode() + text.encode() + errors + TEXT_END
        else:
            record = head.encode() + bytes(self.values(now_s))
            record += self.timestamp(now_s) if flags["D"] else b""
            record += bytes([self.status_byte()]) if flags["U"] else b""
            record += errors + b"\0"
        self.records.append(record)
        self.times.append(now_s)
        return record

    def due(self, now_s: float) -> bytes:
        """Everything the box sends by itself up to now: samples of the stream, the end of a restart."""
        out = b""
        if self._later and now_s >= self.deaf_until_s:
            out, self._later = self._later, b""
        sync = self.settings.flags["Y"] or self.settings.ascii_sync
        while self.streaming and not sync and now_s >= self._next_sample_s:
            out += self.record(self.streaming, self._next_sample_s)
            self._next_sample_s += max(self.asked_period_s, self.wire_period_s)
        return out

    def sync_pulse(self, now_s: float) -> bytes:
        """A pulse on the sync input: one record with head ``Y`` (or ``y``)."""
        if self.streaming and self.settings.flags["Y"]:
            return self.record("Y", now_s)
        return self.record("y", now_s) if self.streaming and self.settings.ascii_sync else b""

    def next_due_s(self) -> float:
        """When to call ``due`` again at the latest."""
        if self._later:
            return self.deaf_until_s
        return self._next_sample_s if self.streaming else float("inf")

    def press(self, down: bool) -> None:
        """The wrist switch; the light follows it when J says so."""
        self.settings.flags["W"] = down
        if self.settings.flags["J"]:
            self.settings.flags["L"] = down

    # ----------------------------------------------------------------- commands
    def feed(self, data: bytes, now_s: float) -> bytes:
        """Bytes from the computer; returns the replies."""
        out = b""
        for value in data:
            if now_s < self.deaf_until_s or (self.stuck and value != 0x12):
                continue
            self._pending += bytes([value])
            if (length := self._length(self._pending)) is not None and len(self._pending) >= length:
                command, self._pending = self._pending, b""
                self.commands.append(command)
                out += self._run(command, now_s)
        return out

    def _length(self, command: bytes) -> int | None:
        """Bytes of the command that begins so, None while that cannot be said."""
        first = command[:1]
        if first == b"?":
            if len(command) < 2:
                return None
            return 3 if command[1:2] == b"E" else 2
        if first == b"C":
            second = {b"A": 2 + 2 * self.sensors, b"O": 4, b"G": 4}.get(command[1:2], 2)
            return second if len(command) > 1 else None
        if first == b"A":
            return None if len(command) < 2 else 8 if command[1] == 255 else 2 + 2 * command[1]
        if first == b"E":
            return 3
        if first in PAYLOAD:
            return 1 + PAYLOAD[first]
        if first.isalpha() and first.upper() in PAYLOAD:  # ASCII form: up to the carriage return
            return len(command) if command[-1:] == b"\r" else None
        return 1

    def _run(self, command: bytes, now_s: float) -> bytes:
        first = command[:1]
        if first in (b"\r", b"\n"):
            return b""
        if first == b"?":
            return self._query(command)
        if first == b"\x03":
            self.streaming = None
            return b"\x03\0"
        if first == b"\x12":
            return self._restart(now_s)
        if first == b"\x09":
            return b"\x09" + TEXT_END
        if first in (b"G", b"g"):
            return self.record(first.decode(), now_s)
        if first in (b"S", b"s"):
            self.streaming, self._next_sample_s = first.decode(), now_s
            return b""
        if first in (b"i", b"v"):
            return first + self._text(first) + TEXT_END
        if first in (b"C", b"A", b"E"):
            return self._memory(command)
        if first in PAYLOAD:
            return first + b"\0" if self._set(first, list(command[1:])) else BAD_NUMBERS
        if first.upper() in PAYLOAD:
            return self._set_ascii(first, command)
        return UNKNOWN

    def _restart(self, now_s: float) -> bytes:
        """ctrl-R: silence, then 0x12 CR LF NUL (one source has it without CR LF)."""
        self.stuck = False
        self._power_up()
        self.deaf_until_s = now_s + self.restart_silence_s
        self._later = b"\x12" + TEXT_END
        return b""

    def _set(self, letter: bytes, numbers: list[int]) -> bool:
        settings = self.settings
        if letter[0] in FLAGS:
            if numbers[0] not in (0, 1):
                return False
            settings.flags[letter.decode()] = bool(numbers[0])
        elif letter == b"M":
            settings.mask = int.from_bytes(bytes(numbers), "little")
        elif letter == b"N":
            if numbers[0] > self.sensors:
                return False
            settings.number = numbers[0]
        elif letter == b"T":
            settings.words = numbers[0] << 8 | numbers[1], numbers[2] << 8 | numbers[3]
        elif letter == b"B":
            return self._set_baud(numbers[0])
        elif letter == b"P":
            self._set_parameters(numbers)
        return True

    def _set_baud(self, value: int) -> bool:
        # 115200 / prescale / 2^n. Sources disagree on where the prescale sits: only n is taken.
        if value & ~0x07:
            return False
        self.settings.baud_byte = value
        self.baud = 115200 >> value
        return True

    def _set_parameters(self, numbers: list[int]) -> None:
        flags, middle = self.settings.flags, numbers[1]
        flags["W"], flags["L"] = bool(numbers[0] & 2), bool(numbers[0] & 4)
        for position, letter in ((0, "Y"), (2, "U"), (3, "J"), (4, "F"), (5, "D")):
            flags[letter] = bool(middle >> position & 1)
        self.settings.ascii_sync = bool(middle >> 1 & 1)
        flags["Q"] = bool(numbers[2] & 1)

    def _parameters(self) -> bytes:
        flags = self.settings.flags
        middle = (
            flags["Y"] | self.settings.ascii_sync << 1 | flags["U"] << 2 | flags["J"] << 3
            | flags["F"] << 4 | flags["D"] << 5 | self.right_hand << 6 | self.glove_plugged << 7
        )  # fmt: skip
        return bytes([self.status_byte(), middle, int(flags["Q"])])

    def _set_ascii(self, letter: bytes, command: bytes) -> bytes:
        """``u 1 CR``. Payload bytes as decimals; the period as its two words."""
        upper = letter.upper()
        try:
            numbers = [int(word) for word in command[1:-1].split()]
        except ValueError:
            return BAD_NUMBERS
        if upper == b"T" and len(numbers) == 2:
            numbers = [byte for word in numbers for byte in (word >> 8 & 0xFF, word & 0xFF)]
        if len(numbers) != PAYLOAD[upper] or not all(0 <= number <= 255 for number in numbers):
            return BAD_NUMBERS
        if letter == b"y":  # both external sync flags are on or off, binary and ASCII apart
            self.settings.ascii_sync = bool(numbers[0])
            return letter + TEXT_END
        return letter + TEXT_END if self._set(upper, numbers) else BAD_NUMBERS

    def _memory(self, command: bytes) -> bytes:
        first, second = command[:1], command[1:2]
        if first == b"A":
            self._set_actuators(command)
            return b"A\0"
        if first == b"E":  # one source, of a later box: address, data
            self.eeprom[command[1]] = command[2]
            return b"E\0"
        if second == b"A":
            self.offsets[:] = command[2 : 2 + self.sensors]
            self.gains[:] = command[2 + self.sensors :]
        elif second in (b"O", b"G"):
            if command[2] >= self.sensors:
                return BAD_NUMBERS
            (self.offsets if second == b"O" else self.gains)[command[2]] = command[3]
        else:
            return UNKNOWN
        return b"C" + second + b"\0"

    def _set_actuators(self, command: bytes) -> None:
        if command[1] == 255:
            self.actuators[:] = command[2:8]
            return
        for index, value in zip(command[2::2], command[3::2], strict=True):
            if index < 6:
                self.actuators[index] = value

    def _query(self, command: bytes) -> bytes:
        letter = command[1:2]
        if letter in (b"i", b"v"):
            return command + self._text(letter) + TEXT_END
        payload = self._answer(letter.upper(), command)
        if payload is None:
            return UNKNOWN
        if letter.isupper():
            return command + payload + b"\0"
        # ASCII answers: right-aligned fields of 4 characters (inferred from one driver that reads 9 bytes).
        numbers = list(payload)
        if letter == b"t":
            numbers = list(self.settings.words)
        return command + "".join(f"{number:4d}" for number in numbers).encode() + TEXT_END

    def _answer(self, letter: bytes, command: bytes) -> bytes | None:
        settings = self.settings
        if letter[0] in FLAGS:
            return bytes([settings.flags[letter.decode()]])
        first, second = settings.words
        answers: dict[bytes, Callable[[], bytes]] = {
            b"G": lambda: bytes([1 | self.glove_plugged << 1]),
            b"S": lambda: bytes([self.sensors]),
            b"B": lambda: bytes([settings.baud_byte]),
            b"M": lambda: (settings.mask & HARDWARE_MASK[self.sensors]).to_bytes(3, "little"),
            b"K": lambda: HARDWARE_MASK[self.sensors].to_bytes(3, "little"),
            b"N": lambda: bytes([settings.number]),
            b"P": self._parameters,
            b"T": lambda: first.to_bytes(2, "big") + second.to_bytes(2, "big"),
            b"R": lambda: bytes([self.right_hand]),
            b"V": lambda: bytes([0, 2, 0, 1]),
            b"C": lambda: bytes(self.offsets + self.gains),
            b"A": lambda: bytes(self.actuators),
            b"E": lambda: bytes([self.eeprom[command[2]]]),
        }
        return answers[letter]() if letter in answers else None

    def _text(self, letter: bytes) -> bytes:
        if letter == b"v":
            return b"2.0 1.0"
        hand = "right" if self.right_hand else "left"
        return f"CyberGlove, {self.sensors} sensors, {hand} hand (emulated, simulated motion)".encode()


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
