"""The capture device ``lucidglove``: a LucidGlove on a serial port, or connecting over WiFi.

Written from the public firmware and its reader; no hardware was at hand. Readings are counts from 0 (open) to
4095 on an ESP32 or 1023 on an AVR. Source: LucidVR/lucidgloves 76472c7 (firmware) and
LucidVR/opengloves-driver a462ff6 (its reader), as collected in the project's fact sheet;
senseshift/opengloves-lib (firmware) for what it leaves out.

Two encodings, one line a sample. Alpha: letters that name a value, digits behind them. Legacy: thirteen
numbers joined by ``&`` (five fingers, joystick x and y, then joystick click, trigger, A, B, grab and pinch as
0 or 1), of which only the fingers are bounded: nothing else is used but the button. Neither has a checksum: a
digit lost inside a number gives another number, which cannot be told from a reading. Everything else that is
damaged is told by the form of the line.
"""

from __future__ import annotations

import re
import time
from collections.abc import Sequence
from typing import ClassVar

from glovecal_client.capture.stream.links import Link
from glovecal_client.capture.stream.parser import (
    BadRecord,
    LineReader,
    Sample,
    StreamParser,
    shown,
    whole_number,
)
from glovecal_client.capture.stream.streamed_glove import COMMON_HELP, OptionValues, StreamedGlove
from glovecal_client.errors import BadOption

_NAMES = (
    "thumb", "index", "middle", "ring", "pinky", "joystick x", "joystick y",
    "joystick click", "trigger", "A", "B", "grab", "pinch",
)  # fmt: skip
_FINGERS = 5
_ANALOG = 7
_BUTTON_VALUE = 9
"""Button A."""


class LegacyLine:
    """Reads the five fingers; ``largest`` is the largest count a finger can have."""

    def __init__(self, largest: int) -> None:
        self._most = [largest] * _FINGERS + [None] * (_ANALOG - _FINGERS) + [1] * (len(_NAMES) - _ANALOG)

    def __call__(self, line: bytes) -> Sample:
        """The sample of a line. Raises BadRecord if it is not thirteen numbers in their ranges."""
        fields = line.split(b"&")
        if len(fields) != len(_NAMES):
            raise BadRecord(f"{len(fields)} fields, not {len(_NAMES)}: is encoding=legacy right?")
        numbers = [
            whole_number(text, most, name)
            for text, most, name in zip(fields, self._most, _NAMES, strict=True)
        ]
        return Sample(tuple(numbers[:_FINGERS]), button=bool(numbers[_BUTTON_VALUE]))


_FIELD = re.compile(rb"(\([A-Z]{1,3}\)|[A-Z])([0-9]*)")
_FLAGS = frozenset(bytes([key]) for key in b"HIJKLMNO")
_NUMBERS = frozenset(bytes([key]) for key in b"ABCDEFGP")
_FINGER_OF_NAME = dict(zip("TIMRP", "ABCDE", strict=True))
KEYS: dict[str, dict[str, str]] = {
    "flexion": {f"{name}_FLEX": finger for name, finger in _FINGER_OF_NAME.items()},
    "splay": {f"{name}_SPLAY": f"({finger}B)" for name, finger in _FINGER_OF_NAME.items()},
    "joints": {
        f"{name}_JOINT{number}": f"({finger}A{joint})"
        for name, finger in _FINGER_OF_NAME.items()
        for number, joint in enumerate("ABCD", 1)
    },
}
"""What a line may hold, by the option ``sensors``: name of the sensor -> key on the line."""
_FIRST_JOINT = b"AA)"
_BUTTON = b"J"
"""Button A."""


class AlphaLine:
    """Reads the sensors behind ``keys``; ``largest`` is the largest count a sensor can have."""

    def __init__(self, keys: Sequence[str], largest: int) -> None:
        self._keys = [key.encode("ascii") for key in keys]
        self._largest = largest

    def __call__(self, line: bytes) -> Sample:
        """The sample of a line. Raises BadRecord: an unreadable place, a key twice, a reading too large.

        Keys that no sensor is behind are passed over, as the OpenGloves driver does, and their values have no
        bound: the firmware's trigger reaches twice half its range, one more than the largest count. Splay and
        joints may be left out beside their finger's flexion, as SenseShift's firmware does where they are 0;
        its first joint is never sent, it is the flexion.
        """
        found: dict[bytes, int] = {}
        at = 0
        while at < len(line):
            field = _FIELD.match(line, at)
            if field is None:
                raise BadRecord(f"no field begins at {shown(line[at:])}")
            key = field[1]
            if key in found:
                raise BadRecord(f"{key.decode()} comes twice")
            found[key] = self._value(key, field[2])
            at = field.end()
        return Sample(tuple(self._reading(key, found) for key in self._keys), button=_BUTTON in found)

    def _value(self, key: bytes, digits: bytes) -> int:
        name = key.decode()
        if key in _FLAGS and digits:
            raise BadRecord(f"{name} is a flag, and {digits.decode()} stands behind it")
        if not digits and key not in _NUMBERS and key not in self._keys:
            return 0
        return whole_number(digits, self._largest if key in self._keys else None, name)

    @staticmethod
    def _reading(key: bytes, found: dict[bytes, int]) -> int:
        if key in found:
            return found[key]
        if len(key) > 1 and key[1:2] in found:
            return found[key[1:2]] if key[2:] == _FIRST_JOINT else 0
        raise BadRecord(f"{key.decode()} is missing")


_ANSWER = b"\n"
"""What the OpenGloves driver writes at least. Lines under five characters set no servo."""
_LONGEST = 256
_SILENCE_S = 0.1
"""Ten lines of the usual rate."""


class LucidGlove(StreamedGlove):
    """Five flexion sensors; with ``sensors=splay`` or ``joints`` also those sent beside them."""

    name = "lucidglove"
    rate_hz: float = 100.0
    usage = "lucidglove:PORT"
    about = "LucidGlove on a serial port; lucidglove:tcp:65432 over WiFi. Counts from 0 to 4095."
    option_help: ClassVar[dict[str, str]] = {
        "encoding": "alpha|legacy (alpha)",
        "sensors": f"{'|'.join(KEYS)} (flexion)",
        "largest": "4095 on an ESP32, 1023 on an AVR (4095)",
        "answer": "line|none (line; firmware with force feedback waits 1 s for one after a sample)",
        "baud": "BAUD (115200)",
        "layout": "NAME (lucidglove; needed with sensors=splay and joints)",
        **COMMON_HELP,
    }

    def __init__(self, address: str, options: OptionValues) -> None:
        """Raises BadOption."""
        self.baud: int = options.whole("baud", 115200, 1200, 3_000_000)
        super().__init__(address, options)
        largest = options.whole("largest", 4095, 1, 65535)
        chosen = options.choice("sensors", {name: name for name in KEYS})
        legacy = options.choice("encoding", {"alpha": False, "legacy": True})
        if legacy and chosen != "flexion":
            raise BadOption(f"lucidglove: encoding=legacy sends no {chosen}; leave sensors={chosen} out")
        self.layout: str = options.text("layout", "lucidglove" if chosen == "flexion" else "")
        if not self.layout:
            raise BadOption(
                f"lucidglove: sensors={chosen} needs layout=NAME, a layout of your own with its sensors "
                f"({', '.join(self._names(chosen))})"
            )
        self.sensors: tuple[str, ...] = self._names(chosen)
        self.counts: tuple[float, float] | None = (0.0, float(largest))
        keys = KEYS["flexion"] | KEYS[chosen]
        self._parse = (
            LegacyLine(largest) if legacy else AlphaLine([keys[name] for name in self.sensors], largest)
        )
        self._answers = options.choice("answer", {"line": True, "none": False})

    @staticmethod
    def _names(chosen: str) -> tuple[str, ...]:
        return tuple(KEYS["flexion"] if chosen == "flexion" else KEYS["flexion"] | KEYS[chosen])

    def new_parser(self) -> StreamParser:
        return LineReader(self._parse, self.counters, longest=_LONGEST)

    def start(self, link: Link) -> None:
        self._answer(link, 1)

    def answer(self, link: Link, data: bytes) -> None:
        """One line for each, damaged ones too: the firmware's loop waits for it, by Arduino's default 1 s.

        Where a line feed was lost on the way the glove waits for an answer to a line nobody saw end; so
        silence is answered too.
        """
        if lines := data.count(b"\n"):
            self._answer(link, lines)
        elif not data and time.monotonic() - self._answered_s > _SILENCE_S:
            self._answer(link, 1)

    def _answer(self, link: Link, lines: int) -> None:
        self._answered_s = time.monotonic()
        if self._answers:
            link.write(_ANSWER * lines)
