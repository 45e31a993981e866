"""The capture device ``homunculus``: the exoskeleton glove of LeRobot, sixteen 12-bit Hall sensors.

One line a sample, sixteen numbers with blanks between them, 120 to 165 a second. Source: huggingface/lerobot
7427f3180, as collected in the project's fact sheet; no hardware was at hand. There is no checksum, header or
time. LeRobot inverts some joints of each side and clips to 0..100; here readings stay as they were sent.
"""

from __future__ import annotations

from typing import ClassVar

from glovecal_client.capture.stream.parser import BadRecord, LineReader, Sample, StreamParser, whole_number
from glovecal_client.capture.stream.streamed_glove import COMMON_HELP, OptionValues, StreamedGlove

SENSORS = (
    "T_CMC", "T_MCP", "T_PIP", "T_DIP",
    *(f"{finger}_{joint}" for finger in "IMRP" for joint in ("ABD", "MCP", "DIP")),
)  # fmt: skip
"""As on the line: the thumb, then of each finger MCP abduction, MCP flexion and the joint called dip."""


class Homunculus(StreamedGlove):
    """Sixteen counts in the order of the line."""

    name = "homunculus"
    layout = "homunculus"
    sensors: tuple[str, ...] = SENSORS
    rate_hz: float = 120.0
    usage = "homunculus:PORT"
    about = "LeRobot Homunculus, an exoskeleton glove on a serial port: sixteen Hall sensors."
    option_help: ClassVar[dict[str, str]] = {
        "largest": "the largest count of the converter (4095)",
        "baud": "BAUD (115200)",
        **COMMON_HELP,
    }

    def __init__(self, address: str, options: OptionValues) -> None:
        """Raises BadOption."""
        self.baud: int = options.whole("baud", 115200, 1200, 3_000_000)
        super().__init__(address, options)
        self._largest = options.whole("largest", 4095, 1, 65535)
        self.counts: tuple[float, float] | None = (0.0, float(self._largest))

    def new_parser(self) -> StreamParser:
        return LineReader(self.parse_line, self.counters)

    def parse_line(self, line: bytes) -> Sample:
        """The sample of a line. Raises BadRecord if it is not sixteen counts."""
        fields = line.split(b" ")
        if len(fields) != len(SENSORS):
            raise BadRecord(f"{len(fields)} fields, not {len(SENSORS)}")
        return Sample(
            tuple(
                whole_number(field, self._largest, name) for field, name in zip(fields, SENSORS, strict=True)
            )
        )
