"""The capture device ``lucidglove``: a LucidGlove on a serial port, or connecting over WiFi.

Written from the public firmware and its reader; no hardware was at hand. Readings are counts from 0 (open) to
4095 on an ESP32 or 1023 on an AVR.
"""

from __future__ import annotations

import time
from typing import ClassVar

from glovecal_client.capture.lucidglove.alpha import KEYS, AlphaLine
from glovecal_client.capture.lucidglove.legacy import LegacyLine
from glovecal_client.capture.stream.lines import LineReader
from glovecal_client.capture.stream.links import Link
from glovecal_client.capture.stream.option_values import COMMON_HELP, OptionValues
from glovecal_client.capture.stream.parser import StreamParser
from glovecal_client.capture.stream.streamed_glove import StreamedGlove
from glovecal_client.errors import BadOption

_ANSWER = b"\n"
"""What the OpenGloves driver writes at least. Lines under five characters set no servo."""
_LONGEST = 256
_SILENCE_S = 0.1
"""Ten lines of the usual rate."""


class LucidGlove(StreamedGlove):
    """Five flexion sensors; with ``sensors=splay`` or ``joints`` also those sent beside them."""

    name = "lucidglove"
    rate_hz: float = 100.0
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
