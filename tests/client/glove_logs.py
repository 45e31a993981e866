"""Test support: byte logs of every streamed protocol, made by the emulators, whole or damaged.

What a log should give comes from the emulator's values, put into the order of the sensors by tables of the
fact sheet that are written down here; nothing of it comes from a driver.
"""

from __future__ import annotations

import random
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Protocol

from glovecal_client.capture.cyberglove3.device import CyberGlove3
from glovecal_client.capture.homunculus import Homunculus
from glovecal_client.capture.line_glove import LineGlove
from glovecal_client.capture.lucidglove import LucidGlove
from glovecal_client.capture.opencyberglove import OpenCyberGlove
from glovecal_client.capture.stream.streamed_glove import StreamedGlove
from glovecal_service.emulators import lines
from glovecal_service.emulators.cyberglove3 import EmulatedCyberGlove3
from glovecal_service.emulators.lines import EmulatedHomunculus, EmulatedLucidGlove
from glovecal_service.emulators.opencyberglove import EmulatedOpenCyberGlove

Values = tuple[float, ...]
RECORDS = 60
HARDWARE_22 = (
    "T_TMC", "T_MCP", "T_IP", "TI_ABD", "I_MCP", "I_PIP", "I_DIP", "M_MCP", "M_PIP", "M_DIP", "IM_ABD",
    "R_MCP", "R_PIP", "R_DIP", "MR_ABD", "P_MCP", "P_PIP", "P_DIP", "RP_ABD", "PALM_ARCH", "W_FLEX", "W_ABD",
)  # fmt: skip
LAYOUT_22 = (
    "T_TMC", "TI_ABD", "T_MCP", "T_IP", "I_MCP", "I_PIP", "IM_ABD", "M_MCP", "M_PIP", "R_MCP", "R_PIP",
    "MR_ABD", "P_MCP", "P_PIP", "RP_ABD", "PALM_ARCH", "W_FLEX", "W_ABD", "I_DIP", "M_DIP", "R_DIP", "P_DIP",
)  # fmt: skip


class Records(Protocol):
    """What the emulators have in common here."""

    def values(self, time_s: float) -> list[int]: ...

    def record(self, values: list[int], time_s: float) -> bytes: ...


@dataclass(frozen=True)
class Case:
    """A protocol: its driver, its records, and whether a changed byte must be noticed."""

    device: Callable[[], StreamedGlove]
    records: Callable[[], list[tuple[bytes, Values]]]
    checksum: bool
    lines: bool


def _sent(glove: Records, rate_hz: float) -> list[tuple[bytes, Values]]:
    found = []
    for number in range(RECORDS):
        values = glove.values(number / rate_hz)
        found.append((glove.record(values, number / rate_hz), tuple(values)))
    return found


def _cyberglove3() -> list[tuple[bytes, Values]]:
    glove, found = EmulatedCyberGlove3(), []
    glove.feed(b"1m\x03", 0.0)
    for number in range(RECORDS):
        words = dict(zip(HARDWARE_22, glove.words(number / 90), strict=True))
        found.append((glove.record(number / 90), tuple(words[name] for name in LAYOUT_22)))
    return found


def line_device(folder: Path, text: str = lines.DESCRIPTION, **options: str) -> LineGlove:
    """The driver for a description, which is kept in ``folder``."""
    file = folder / "glove.toml"
    file.write_text(text)
    return LineGlove.from_options(str(file), {"port": "nowhere", **options})


def _described() -> StreamedGlove:
    """The description is read once and not kept."""
    with tempfile.TemporaryDirectory() as folder:
        return line_device(Path(folder))


def _options(device: type[StreamedGlove], **options: str) -> Callable[[], StreamedGlove]:
    return lambda: device.from_options("nowhere", options)  # type: ignore[attr-defined]


CASES: Mapping[str, Case] = {
    "lucidglove": Case(_options(LucidGlove), lambda: _sent(EmulatedLucidGlove(), 100), False, True),
    "lucidglove-legacy": Case(
        _options(LucidGlove, encoding="legacy"),
        lambda: _sent(EmulatedLucidGlove(legacy=True), 100), False, True,
    ),
    "homunculus": Case(_options(Homunculus), lambda: _sent(EmulatedHomunculus(), 60), False, True),
    "line": Case(
        _described, lambda: _sent(lines.EmulatedLineGlove(), 50), True, True
    ),
    "opencyberglove": Case(
        _options(OpenCyberGlove), lambda: _sent(EmulatedOpenCyberGlove(), 120), True, False
    ),
    "cyberglove3": Case(_options(CyberGlove3), _cyberglove3, False, False),
}  # fmt: skip


@cache
def records_of(name: str) -> list[tuple[bytes, Values]]:
    """Records of a protocol and the readings in each."""
    return CASES[name].records()


def in_pieces(data: bytes, chance: random.Random) -> list[bytes]:
    """``data`` as a port would hand it over: pieces of 1 to 90 bytes."""
    pieces, at = [], 0
    while at < len(data):
        length = chance.randint(1, 90)
        pieces.append(data[at : at + length])
        at += length
    return pieces


def noise(record: bytes, chance: random.Random) -> bytes:
    return chance.randbytes(chance.randint(1, 40)) + record


def cut_end(record: bytes, chance: random.Random) -> bytes:
    return record[: chance.randrange(1, len(record))]


def cut_beginning(record: bytes, chance: random.Random) -> bytes:
    return record[chance.randrange(1, len(record)) :]


def repeated(record: bytes, chance: random.Random) -> bytes:
    return record[: chance.randrange(1, len(record))] + record


def zeros(record: bytes, chance: random.Random) -> bytes:
    at = chance.randrange(len(record))
    return record[:at] + bytes(chance.randint(1, 20)) + record[at:]


def swallowed(record: bytes, chance: random.Random) -> bytes:
    return b""


def lost_byte(record: bytes, chance: random.Random) -> bytes:
    at = chance.randrange(len(record))
    return record[:at] + record[at + 1 :]


def flipped_bit(record: bytes, chance: random.Random) -> bytes:
    changed = bytearray(record)
    changed[chance.randrange(len(record))] ^= 1 << chance.randrange(8)
    return bytes(changed)


WHOLE_RECORDS = (noise, cut_end, repeated, zeros, swallowed)
"""Damage that no protocol may take for a reading: nothing else than what was sent may come out."""
INSIDE_VALUES = (cut_beginning, lost_byte, flipped_bit)
"""May leave another number behind, which only a checksum can tell: 4095 without its first digit."""
