"""The capture device ``opencyberglove``: an OpenCyberGlove on its USB serial port, 120 packets a second.

Written from its public source; no hardware was at hand. It takes no commands.
"""

from __future__ import annotations

from typing import ClassVar

from glovecal_client.capture.device_clock import DeviceClock
from glovecal_client.capture.opencyberglove.packet import LARGEST, SENSORS, PacketReader
from glovecal_client.capture.stream.option_values import COMMON_HELP, OptionValues
from glovecal_client.capture.stream.parser import StreamParser
from glovecal_client.capture.stream.streamed_glove import StreamedGlove

_TICKS_PER_SECOND = {"computer": None, "glove_us": 1_000_000, "glove_ms": 1_000}


class OpenCyberGlove(StreamedGlove):
    """Nineteen tensile sensors, named by their place in the packet; the layout says what each crosses."""

    name = "opencyberglove"
    layout = "opencyberglove"
    sensors: tuple[str, ...] = tuple(f"TENSILE_{number}" for number in range(SENSORS))
    counts: tuple[float, float] | None = (0.0, float(LARGEST))
    rate_hz: float = 120.0
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
