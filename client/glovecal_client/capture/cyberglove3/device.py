"""The capture device ``cyberglove3``: a CyberGlove III on its USB port, or connecting over WiFi.

Written from the vendor's manual and public drivers; no hardware was at hand. It streams its own 12-bit
records. Readings are counts from 1 to 4095, sixteen times as fine as those of the CyberGlove I/II mode.
"""

from __future__ import annotations

from typing import Any, ClassVar

from glovecal_client.capture.cyberglove.identity import SENSORS, hardware_order
from glovecal_client.capture.cyberglove3.commands import (
    COMMANDS,
    START,
    STOP,
    battery_volts,
    command,
    quiet,
    run_command,
)
from glovecal_client.capture.cyberglove3.record import LARGEST, TimedRecordReader
from glovecal_client.capture.device_clock import DeviceClock, OwnClock
from glovecal_client.capture.stream.links import Link
from glovecal_client.capture.stream.parser import Counters, Sample, StreamParser
from glovecal_client.capture.stream.streamed_glove import COMMON_HELP, OptionValues, StreamedGlove
from glovecal_client.errors import BadOption

_LOW_BATTERY_V = 6.8
"""Of two lithium cells; the manual names no limit, so this is ours."""
_SECONDS_A_DAY = 86400
LAYOUTS = {"cyberglove3-22": SENSORS["cyberglove22"], "cyberglove3-18": SENSORS["cyberglove18"]}


class CyberGlove3(StreamedGlove):
    """22 or 18 sensors, in the order of the layouts of CyberGlove I/II."""

    name = "cyberglove3"
    counts: tuple[float, float] | None = (1.0, float(LARGEST))
    commands: ClassVar[dict[str, str]] = COMMANDS
    usage = "cyberglove3:PORT"
    about = "CyberGlove III on its USB port; cyberglove3:tcp:5210 over WiFi. Counts from 1 to 4095."
    option_help: ClassVar[dict[str, str]] = {
        "layout": f"{'|'.join(LAYOUTS)} (cyberglove3-22)",
        "multiplier": "1|2|3|4 (3): records for each frame of its clock; 4 may lose records over WiFi",
        "frame_rate": "HZ of its clock (30; other with an LTC signal)",
        "clock": "computer|glove (computer; glove takes times from the records)",
        "timecode": "none|ltc (none; ltc: its clock follows an LTC signal that others follow too)",
        "destinations": "set|leave (set; leave sends no 1e and 1d, after which one left glove stopped)",
        "battery": "ask|leave (ask)",
        "baud": "BAUD (115200)",
        **COMMON_HELP,
    }

    def __init__(self, address: str, options: OptionValues) -> None:
        """Raises BadOption."""
        self.baud: int = options.whole("baud", 115200, 1200, 3_000_000)
        super().__init__(address, options)
        self.layout: str = options.choice("layout", {name: name for name in LAYOUTS})
        self.sensors: tuple[str, ...] = LAYOUTS[self.layout]
        self._multiplier = options.whole("multiplier", 3, 1, 4)
        self._frame_rate = options.number("frame_rate", 30.0, 10.0, 60.0)
        self._by_its_clock = options.choice("clock", {"computer": False, "glove": True})
        self._set_destinations = options.choice("destinations", {"set": True, "leave": False})
        self._ask_battery = options.choice("battery", {"ask": True, "leave": False})
        self.clock_kind: str = options.choice("timecode", {"none": "own", "ltc": "ltc"})
        self._on_card = False
        self._over_network = address.startswith("tcp:")
        self.rate_hz: float = self._frame_rate * self._multiplier

    def command(self, name: str, argument: str) -> dict[str, Any]:
        """One of ``card_commands``; the stream pauses meanwhile. Raises DeviceLost, BadOption.

        A recording on the card would pause too, so until it is stopped nothing else is asked.
        """
        if self._on_card and name != "stop":
            raise BadOption(f"the glove records on its card: stop that before {name!r}")
        answer = self.between_records(lambda link: run_command(link, name, argument, self._frame_rate))
        self._on_card = bool(answer.get("recording", False))
        return answer

    def start(self, link: Link) -> None:
        """Quiet, battery, destinations, rate, stream. Raises DeviceLost."""
        quiet(link)
        volts = battery_volts(link) if self._ask_battery else None
        replies = []
        if self._set_destinations:
            on, off = (b"w", b"u") if self._over_network else (b"u", b"w")
            replies += [command(link, b"1e" + on), command(link, b"1d" + off)]
        replies.append(command(link, b"1m" + bytes([self._multiplier])))
        # What another program divided the rate by stays in the glove: 3 makes 30 Hz of 90.
        replies += [command(link, divider + b"\x01") for divider in (b"1u", b"1w")]
        self.notice: str = "; ".join(_notices(volts, sum(not reply.echoed for reply in replies)))
        link.write(START)

    def stop(self, link: Link) -> None:
        link.write(STOP)

    def new_parser(self) -> StreamParser:
        return TimedSamples(self.counters, self.sensors, self._frame_rate, self._multiplier)

    def new_clock(self) -> DeviceClock | None:
        return DeviceClock(*self._ticks()) if self._by_its_clock else None

    def new_own_clock(self) -> OwnClock | None:
        return OwnClock(*self._ticks())

    def _ticks(self) -> tuple[float, int]:
        """A second, and a day, after which its clock begins anew."""
        ticks_per_second = self._frame_rate * self._multiplier
        return ticks_per_second, int(_SECONDS_A_DAY * ticks_per_second)


class TimedSamples:
    """Records as samples in the order of ``sensors``, their times counted in sub-samples since midnight."""

    def __init__(
        self, counters: Counters, sensors: tuple[str, ...], frame_rate: float, multiplier: int
    ) -> None:
        self._places = word_places(sensors)
        self._reader = TimedRecordReader(counters, self._places)
        self._frame_rate = frame_rate
        self._multiplier = multiplier

    def feed(self, data: bytes) -> list[Sample]:
        return [
            Sample(
                tuple(record.words[place] for place in self._places),
                round((record.second_of_day * self._frame_rate + record.frame) * self._multiplier)
                + record.sub_sample,
            )
            for record in self._reader.feed(data)
        ]


def word_places(sensors: tuple[str, ...]) -> tuple[int, ...]:
    """Which word of a record each sensor is: the hardware order of 22, also in a glove with 18."""
    order = hardware_order(22)
    return tuple(order.index(name) for name in sensors)


def _notices(volts: float | None, dropped: int) -> list[str]:
    notices = []
    if volts is not None:
        low = ", nearly empty" if volts < _LOW_BATTERY_V else ""
        notices.append(f"battery {volts:.2f} V{low}")
    if dropped:
        notices.append(f"{dropped} echoes came damaged")
    return notices
