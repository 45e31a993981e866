"""The capture device ``cyberglove``: a CyberGlove I or II on a serial port.

Written from public drivers and manuals; no hardware was at hand. It speaks the 8-bit binary protocol:
readings are counts from 1 to 255, about a degree each, in the order of the layout.

Its stream ends in several ways without the port going away. A cable pulled between the adapter and the box is
plain silence; a glove pulled from its box gives error records; a port taken over by something else gives
garbage. Only time spent waiting counts, so a caller that was busy elsewhere does not make the glove look
lost.
"""

from __future__ import annotations

import logging
import time
from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from glovecal_client.capture.cyberglove import find_port
from glovecal_client.capture.cyberglove.box import Unanswered
from glovecal_client.capture.cyberglove.connection import BAUD_RATES, connect
from glovecal_client.capture.cyberglove.identity import SENSORS, Identity, identify, layout_index
from glovecal_client.capture.cyberglove.record import TICKS_PER_SECOND, Record, RecordReader
from glovecal_client.capture.cyberglove.setup import (
    DEFAULT_RATE_HZ,
    OPTION_HELP,
    CyberGloveOptions,
    StreamSetup,
    set_up,
)
from glovecal_client.capture.device import Reading
from glovecal_client.capture.device_clock import ArrivalTimes, DeviceClock
from glovecal_client.capture.serial_link import SerialLink
from glovecal_client.clock import clock_ns, wall_ns
from glovecal_client.errors import DeviceError, DeviceLost, reason_of

_WAIT_S = 0.05
_logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Counters:
    """What went wrong in the stream since the device was built, over all openings."""

    bad_frames: int = 0
    resyncs: int = 0
    skipped_bytes: int = 0


class CyberGlove:
    """A CyberGlove on ``port`` (None: the only one found).

    Without options it tries the usual baud rates in turn, streams at 100 Hz, or what the wire carries, and
    takes the layout from the glove: ``cyberglove18`` is a guess until it has been opened.
    """

    name = "cyberglove"
    context: tuple[str, ...] = ()
    counts: tuple[float, float] = (1.0, 255.0)
    option_help = OPTION_HELP
    usage = "cyberglove:PORT"
    about = "CyberGlove I or II on a serial port: counts from 1 to 255."

    def __init__(self, port: str | None = None, options: CyberGloveOptions | None = None) -> None:
        self.port = port
        self.options: CyberGloveOptions = options or CyberGloveOptions()
        self.layout = self.options.layout or "cyberglove18"
        self.sensors = SENSORS[self.layout]
        self.rate_hz = self.options.rate_hz or DEFAULT_RATE_HZ
        self.simulated = False
        self.hand = "unknown"
        self.identity: Identity | None = None
        """What the glove said about itself when it was last opened."""
        self.notice = ""
        """A sentence about what is not as asked for, such as a lower rate; else empty."""
        self._asked_port = port
        self._bauds = BAUD_RATES if self.options.baud is None else (self.options.baud,)
        self._link: SerialLink | None = None
        self._before = Counters()
        self._ready: deque[Reading] = deque()
        self._last_ns = 0

    @classmethod
    def from_options(cls, argument: str | None, options: Mapping[str, str]) -> CyberGlove:
        """``cyberglove:PORT`` with the options of CyberGloveOptions.

        With no layout given it asks the glove, so that layout, hand and rate are right before it is opened;
        a glove that is not there yet is taken for the layout ``cyberglove18``. Raises BadOption, and
        DeviceError when the port has something else on it.
        """
        device = cls(argument or None, CyberGloveOptions.parse(options))
        if device.options.layout is None:
            try:
                device.open()
                device.close()
            except DeviceLost as error:
                _logger.warning("%s; taken for cyberglove18 (option layout)", error)
                device.options = replace(device.options, layout=device.layout)
        return device

    @property
    def counters(self) -> Counters:
        """Bad frames, losses of rhythm and skipped bytes so far."""
        if self._link is None:
            return self._before
        reader = self._reader
        return Counters(
            self._before.bad_frames + reader.bad_frames,
            self._before.resyncs + reader.resyncs,
            self._before.skipped_bytes + reader.skipped_bytes,
        )

    # ------------------------------------------------------------------ opening
    def open(self) -> None:
        """Find the box, ask it who it is, set it up, start the stream.

        Raises DeviceLost when nothing answers, no glove is plugged into the box or the port is gone;
        DeviceError when something else answers (within about 6 s) or the glove cannot do what was asked.
        """
        self.close()
        self.port = self._asked_port or find_port.only_cyberglove()
        try:
            found = connect(self.port, self._bauds)
        except DeviceError as error:
            # What worked a moment ago is lost for now, whatever half-plugged noise its port gives.
            raise (error if self.identity is None else DeviceLost(str(error))) from error
        try:
            identity = identify(found.box, found.sensors)
            self._check_glove(identity)
            options = self.options
            setup = set_up(found.box, identity.sensors, options.rate_hz, options.timestamp)
            self._adopt(identity, setup, found.link.baud)
            found.box.stream()
        except BaseException as error:
            found.link.close()
            if isinstance(error, Unanswered) and not error.refused:
                raise DeviceLost(
                    f"{self.port} stopped answering while it was set up: {reason_of(error)}"
                ) from error
            raise
        self._link = found.link

    def _check_glove(self, identity: Identity) -> None:
        asked = self.options.layout or (self.identity.layout if self.identity else identity.layout)
        if identity.layout != asked:
            raise DeviceError(
                f"the glove on {self.port} has {identity.sensors} sensors, but layout {asked} was expected: "
                f"start again with the option layout={identity.layout}"
            )
        if not identity.plugged:
            raise DeviceLost(f"the control box on {self.port} answers, but no glove is plugged into it")

    def _adopt(self, identity: Identity, setup: StreamSetup, baud: int) -> None:
        self.identity = identity
        self.layout: str = identity.layout
        self.sensors: tuple[str, ...] = SENSORS[identity.layout]
        self.hand: str = identity.hand
        self.simulated: bool = identity.simulated
        self.rate_hz: float = setup.rate_hz
        self.notice: str = setup.notice
        if self.notice:
            _logger.warning("%s: %s", self.port, self.notice)
        self._index = np.array(layout_index(identity.sensors))
        self._reader = RecordReader(setup.record_format)
        self._clock = DeviceClock(TICKS_PER_SECOND) if setup.record_format.timestamp else None
        self._arrivals = ArrivalTimes(self.rate_hz)
        self._watch = StreamWatch(1 / self.rate_hz)
        if len(self._bauds) > 1:  # begin with what worked when it is opened again
            self._bauds = (baud, *(rate for rate in BAUD_RATES if rate != baud))

    # ------------------------------------------------------------------ reading
    def read(self, timeout_s: float) -> Reading | None:
        """The next sound record in layout order, None if none came in time.

        Records with a zero byte or an error mark are counted, never returned. Raises DeviceLost when the port
        is gone, the stream stays silent or the glove is pulled from its box, each within 0.5 s.
        """
        deadline = time.monotonic() + timeout_s
        while not self._ready:
            link = self._link
            if link is None:
                raise DeviceLost(f"the CyberGlove on {self.port or 'its port'} is not open")
            now = time.monotonic()
            try:
                data = link.read(max(0.0, min(_WAIT_S, deadline - now)))
                records = self._reader.feed(data)
                # a computer too busy to wake this process in time says nothing about the glove
                waited_s = min(_WAIT_S, time.monotonic() - now)
                self._watch.note(waited_s, bool(data), bool(records), self._reader.errors)
                self._keep_alive(link)
            except DeviceLost:
                self._let_go()
                raise
            self._ready.extend(self._readings(records))
            if not self._ready and time.monotonic() >= deadline:
                return None
        return self._ready.popleft()

    def _keep_alive(self, link: SerialLink) -> None:
        if reason := self._watch.lost_because():
            raise DeviceLost(f"{self.port}: {reason}")
        if self._watch.should_nudge():
            link.apply_settings_again()
            link.write(b"S")

    def _readings(self, records: list[Record]) -> list[Reading]:
        """Give records that came together the times at which they were taken."""
        now_ns, offset_ns = clock_ns(), wall_ns() - clock_ns()
        readings = []
        for stamp, record in zip(self._arrivals.of(len(records), now_ns), records, strict=True):
            values = np.frombuffer(record.values, np.uint8)[self._index].astype(np.float32)
            if self._clock is not None and record.ticks is not None:
                stamp = self._clock.monotonic_ns(record.ticks, now_ns)
            self._last_ns = max(stamp, self._last_ns + 1)
            readings.append(Reading(values, self._last_ns, self._last_ns + offset_ns, button=record.button))
        return readings

    def close(self) -> None:
        """Stop the stream and let go of the port; harmless when already closed."""
        if self._link is None:
            return
        try:
            self._link.write(b"\x03")
        except DeviceLost as error:
            _logger.debug("closing a port that is gone: %s", error)
        self._let_go()

    def _let_go(self) -> None:
        self._before = self.counters
        link, self._link = self._link, None
        self._ready.clear()
        if link is not None:
            link.close()


_NUDGE_S, _SILENT_S, _UNPLUGGED_S, _GARBAGE_S = 0.2, 0.4, 0.25, 2.0


class StreamWatch:
    """``period_s`` is the time between records; slow streams are given several of them."""

    def __init__(self, period_s: float) -> None:
        self._nudge_s = max(_NUDGE_S, 2.5 * period_s)
        self._silent_s = max(_SILENT_S, 5 * period_s)
        self._unplugged_s = max(_UNPLUGGED_S, 2.5 * period_s)
        self._garbage_s = max(_GARBAGE_S, 5 * period_s)
        self._silent_for_s = 0.0
        self._useless_for_s = 0.0
        self._errors: Counter[str] = Counter()
        self._errors_before: Counter[str] = Counter()
        self._nudged = False

    def note(self, waited_s: float, bytes_came: bool, records_came: bool, errors: Counter[str]) -> None:
        """After each wait: how long it was, what it brought, and the reader's error counts so far."""
        self._errors = errors
        self._silent_for_s = 0.0 if bytes_came else self._silent_for_s + waited_s
        if bytes_came:
            self._nudged = False
        if records_came:
            self._useless_for_s = 0.0
            self._errors_before = Counter(errors)
        else:
            self._useless_for_s += waited_s

    def should_nudge(self) -> bool:
        """True once per silence: time to apply the port's settings again and ask for the stream anew."""
        if self._nudged or self._silent_for_s < self._nudge_s:
            return False
        self._nudged = True
        return True

    def lost_because(self) -> str:
        """Why the stream counts as lost, empty while it does not."""
        if self._silent_for_s >= self._silent_s:
            return (
                f"no bytes for {self._silent_for_s:.1f} s: "
                "is the control box switched on and its cable plugged in?"
            )
        since = self._errors - self._errors_before
        if self._useless_for_s >= self._unplugged_s and (since["g"] or since["zero"]):
            return "the control box says that the glove is not plugged into it"
        if self._useless_for_s >= self._unplugged_s and since["s"]:
            return "the control box says that the sampling rate is too fast: give a lower rate"
        if self._useless_for_s >= self._garbage_s:
            return (
                f"only unreadable bytes for {self._useless_for_s:.1f} s: "
                "the baud rate has changed or another device took the port"
            )
        return ""
