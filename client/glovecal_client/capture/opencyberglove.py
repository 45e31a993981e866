"""The capture device ``opencyberglove``: an OpenCyberGlove on its USB serial port, 120 packets a second.

Written from its public source (CyberOrigin2077/open_cyber_glove c0711e4, as collected in the project's fact
sheet); no hardware was at hand. It takes no commands.

Packets of 132 bytes, little-endian, are found by their checksum: there is no start byte. Bytes 0-75 nineteen
int32 of tensile sensors, 0 to 16384; 76-111 acceleration, angular rate and magnetic field (three float32
each); 112 temperature (float32); 116 time stamp (uint32); 120-127 not described and not covered by the
checksum; 128 CRC-32 (zlib's) of bytes 0-119.
"""

from __future__ import annotations

import math
import re
import struct
import zlib
from typing import ClassVar

from glovecal_client.capture.device_clock import DeviceClock
from glovecal_client.capture.stream.parser import Counters, Sample, StreamParser
from glovecal_client.capture.stream.streamed_glove import COMMON_HELP, OptionValues, StreamedGlove

LENGTH = 132
SENSORS = 19
LARGEST = 16384
_COVERED = 120
_TENSILE = struct.Struct(f"<{SENSORS}i")
_TEMPERATURE_AND_TICKS = struct.Struct("<fI")
_CHECKSUM = struct.Struct("<I")
_LIKELY = re.compile(rb"(?s)(?=(?:.[\x00-\x40]\x00\x00){%d})" % SENSORS)
"""Where nineteen numbers of at most 0x40FF begin: the checksum is worked out nowhere else."""


class PacketReader:
    """Slides over the stream until range and checksum fit.

    ``bad_frames`` counts each loss of rhythm once: in a stream without a start byte damaged packets cannot be
    counted one by one.
    """

    def __init__(self, counters: Counters, *, temperature: bool = False) -> None:
        self._counters = counters
        self._temperature = temperature
        self._buffer = bytearray()
        self._in_step = False

    def feed(self, data: bytes) -> list[Sample]:
        """The sound packets completed by ``data``."""
        self._buffer += data
        samples: list[Sample] = []
        at = 0
        while len(self._buffer) - at >= LENGTH:
            if (sample := self._packet(at)) is not None:
                samples.append(sample)
                self._in_step = True
                at += LENGTH
                continue
            if self._in_step:
                self._in_step = False
                self._counters.bad_frames += 1
            likely = _LIKELY.search(self._buffer, at + 1)
            last = len(self._buffer) - LENGTH + 1
            following = last if likely is None else min(likely.start(), last)
            self._counters.skipped_bytes += following - at
            at = following
        del self._buffer[:at]
        return samples

    def _packet(self, at: int) -> Sample | None:
        packet = self._buffer[at : at + LENGTH]
        values = _TENSILE.unpack_from(packet)
        if min(values) < 0 or max(values) > LARGEST:
            return None
        (checksum,) = _CHECKSUM.unpack_from(packet, LENGTH - 4)
        if zlib.crc32(packet[:_COVERED]) != checksum:
            return None
        temperature, ticks = _TEMPERATURE_AND_TICKS.unpack_from(packet, 112)
        context = (temperature if math.isfinite(temperature) else math.nan,) if self._temperature else ()
        return Sample(values, ticks, context)


_TICKS_PER_SECOND = {"computer": None, "glove_us": 1_000_000, "glove_ms": 1_000}


class OpenCyberGlove(StreamedGlove):
    """Nineteen tensile sensors, named by their place in the packet; the layout says what each crosses."""

    name = "opencyberglove"
    layout = "opencyberglove"
    sensors: tuple[str, ...] = tuple(f"TENSILE_{number}" for number in range(SENSORS))
    counts: tuple[float, float] | None = (0.0, float(LARGEST))
    rate_hz: float = 120.0
    usage = "opencyberglove:PORT"
    about = "OpenCyberGlove on its USB serial port: nineteen tensile sensors."
    option_help: ClassVar[dict[str, str]] = {
        "clock": f"{'|'.join(_TICKS_PER_SECOND)} (computer; microseconds are documented)",
        "context": "none|temperature_c (none; the packet's temperature is kept with each frame)",
        "baud": "BAUD (1000000)",
        **COMMON_HELP,
    }

    def __init__(self, address: str, options: OptionValues) -> None:
        """Raises BadOption."""
        self.baud: int = options.whole("baud", 1_000_000, 1200, 4_000_000)
        super().__init__(address, options)
        self._ticks_per_second = options.choice("clock", _TICKS_PER_SECOND)
        self.context: tuple[str, ...] = options.choice(
            "context", {"none": (), "temperature_c": ("temperature_c",)}
        )

    def new_parser(self) -> StreamParser:
        return PacketReader(self.counters, temperature=bool(self.context))

    def new_clock(self) -> DeviceClock | None:
        return None if self._ticks_per_second is None else DeviceClock(self._ticks_per_second)
