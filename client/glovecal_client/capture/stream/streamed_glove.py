"""The device around a parser: opens the link, feeds the parser, gives readings their times, notices a loss.

A driver is a subclass that says what its glove is and makes its parser; ``docs/own-glove.md`` builds one.
Options come as text, and are read with a sentence for what cannot be.
"""

from __future__ import annotations

import contextlib
import logging
import math
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import numpy as np

from glovecal_client.capture.device import Reading, check_options
from glovecal_client.capture.device_clock import ArrivalTimes, DeviceClock, OwnClock
from glovecal_client.capture.stream.links import Link, Place, place_of
from glovecal_client.capture.stream.parser import Counters, Sample, StreamParser
from glovecal_client.clock import clock_ns, wall_ns
from glovecal_client.errors import BadOption, DeviceError, DeviceLost

if TYPE_CHECKING:
    from typing_extensions import Self  # the client runs on Python 3.10


Value = TypeVar("Value")
COMMON_HELP = {
    "hand": "left|right|unknown (unknown)",
    "simulated": "yes|no (no; yes where the port's name begins with emulated-)",
}
"""Options that every streamed glove has."""


class OptionValues:
    """The options given to ``device``. Raises BadOption for one that is not in ``option_help``."""

    def __init__(self, device: str, given: Mapping[str, str], option_help: Mapping[str, str]) -> None:
        check_options(device, given, option_help)
        self._device = device
        self._given = given

    def choice(self, key: str, choices: Mapping[str, Value]) -> Value:
        """What the option's text stands for; the first choice when it is not given."""
        text = self._given.get(key, next(iter(choices)))
        if text not in choices:
            raise BadOption(f"{self._device}: {key}={text!r} must be one of {', '.join(choices)}")
        return choices[text]

    def number(self, key: str, otherwise: float, low: float, high: float) -> float:
        """A number from ``low`` to ``high``."""
        text = self._given.get(key, f"{otherwise:g}")
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            raise BadOption(f"{self._device}: {key}={text!r} must be a number from {low:g} to {high:g}")
        return value

    def whole(self, key: str, otherwise: int, low: int, high: int) -> int:
        """A whole number from ``low`` to ``high``."""
        value = self.number(key, otherwise, low, high)
        if value != int(value):
            raise BadOption(f"{self._device}: {key}={value:g} must be a whole number from {low} to {high}")
        return int(value)

    def text(self, key: str, otherwise: str) -> str:
        """The option as it was written."""
        return self._given.get(key, otherwise)


EMULATED_PREFIX = "emulated-"
"""A port of this name is an emulator's: its readings are marked as simulated whatever the options say."""
_WAIT_S = 0.05
_FIRST_S = 4.0
"""Until the first record: a microcontroller restarts when its port is opened."""
_GARBAGE_S = 2.0
_logger = logging.getLogger(__name__)
Said = TypeVar("Said")


class StreamedGlove:
    """Base of gloves that send by themselves: a subclass sets the attributes and overrides the hooks."""

    name = "glove"
    layout = ""
    sensors: tuple[str, ...] = ()
    context: tuple[str, ...] = ()
    counts: tuple[float, float] | None = None
    rate_hz: float = 60.0
    """Nominal; the rate is measured while it streams."""
    baud = 115200
    clock_kind = "own"
    """Or "ltc": its clock follows a time code that other devices follow too."""
    option_help: ClassVar[dict[str, str]] = dict(COMMON_HELP)

    def __init__(self, address: str, options: OptionValues) -> None:
        """Raises BadOption. A subclass reads its own options before or after this."""
        self.hand: str = options.choice("hand", {name: name for name in ("unknown", "left", "right")})
        self.simulated: bool = options.choice("simulated", {"no": False, "yes": True}) or (
            PurePath(address).name.startswith(EMULATED_PREFIX)
        )
        self.notice = ""
        self.counters: Counters = Counters()
        self._place: Place = place_of(address, self.baud, self.name)
        self._link: Link | None = None
        self._ready: deque[Reading] = deque()
        self._last_ns = 0
        self._own_clock: OwnClock | None = None

    @classmethod
    def from_options(cls, argument: str | None, options: Mapping[str, str]) -> Self:
        """``NAME:PORT`` or ``NAME:tcp:NUMBER``; overridden where the argument is none. Raises BadOption."""
        return cls(argument or "", OptionValues(cls.name, options, cls.option_help))

    # ------------------------------------------------------------------ hooks of a driver
    def new_parser(self) -> StreamParser:
        """A fresh parser that counts in ``self.counters``."""
        raise NotImplementedError

    def new_clock(self) -> DeviceClock | None:
        """The clock behind the samples' ticks, None to go by the time of arrival."""
        return None

    def new_own_clock(self) -> OwnClock | None:
        """What measures the clock behind the samples' ticks, None for a glove without one."""
        return None

    def start(self, link: Link) -> None:
        """Make the glove send. Raises DeviceLost when it does not answer."""

    def answer(self, link: Link, data: bytes) -> None:
        """After each wait, with what came, perhaps nothing: what a glove that waits for an answer wants."""

    def stop(self, link: Link) -> None:
        """Make the glove stop sending, before the link is closed."""

    # ------------------------------------------------------------------ the device
    def open(self) -> None:
        """Open the link and start the glove. Raises DeviceLost, DeviceError."""
        self.close()
        link = self._place.open()
        try:
            self.start(link)
        except BaseException:
            link.close()
            raise
        self._parser = self.new_parser()
        self._clock = self.new_clock()
        self._arrivals = ArrivalTimes(self.rate_hz)
        self._own_clock = self._own_clock or self.new_own_clock()
        self._silent_s = self._useless_s = 0.0
        self._seen_one = False
        self._link = link

    def read(self, timeout_s: float) -> Reading | None:
        """The next sound record, None if none came in time.

        Raises DeviceLost when the link is gone, or silent for 0.4 s (5 s in a network; five records of a slow
        glove), or when nothing readable came for 2 s.
        """
        deadline = time.monotonic() + timeout_s
        while not self._ready:
            link = self._link
            if link is None:
                raise DeviceLost(f"the glove at {self._place.name} is not open")
            begun = time.monotonic()
            try:
                data = link.read(max(0.0, min(_WAIT_S, deadline - begun)))
                samples = self._parser.feed(data) if data else []
                self.answer(link, data)
                self._watch(time.monotonic() - begun, bool(data), bool(samples))
            except DeviceLost:
                self._let_go()
                raise
            self._ready.extend(self._readings(samples))
            if not self._ready and time.monotonic() >= deadline:
                return None
        return self._ready.popleft()

    @property
    def own_clock(self) -> dict[str, Any] | None:
        """How the glove's own clock stands against the computer's; None while that is not known."""
        line = None if self._own_clock is None else self._own_clock.line
        return None if line is None else {"kind": self.clock_kind, **line.document()}

    def between_records(self, say: Callable[[Link], Said]) -> Said:
        """Pause the stream, ``say`` something to the glove, and go on. Raises DeviceLost and what it raises.

        Records that were on their way are lost with the pause; those read already are not.
        """
        if self._link is None:
            raise DeviceLost(f"the glove at {self._place.name} is not open")
        try:
            self.stop(self._link)
            try:
                answer = say(self._link)
            finally:
                self.start(self._link)
        except DeviceLost:
            self._let_go()
            raise
        self._parser = self.new_parser()
        self._silent_s = self._useless_s = 0.0
        return answer

    def close(self) -> None:
        """Stop the glove and let go of everything; harmless when already closed.

        After a loss a network port stays open for the glove to come back to, until the next close.
        """
        if self._link is None:
            return
        with contextlib.suppress(DeviceError):  # a link that is gone tells nothing new
            self.stop(self._link)
        self._let_go()
        self._place.close()

    def _let_go(self) -> None:
        link, self._link = self._link, None
        self._ready.clear()
        if link is not None:
            link.close()

    def _watch(self, waited_s: float, bytes_came: bool, samples_came: bool) -> None:
        """Only time spent waiting counts, so a caller that was busy elsewhere loses no glove."""
        self._silent_s = 0.0 if bytes_came else self._silent_s + waited_s
        self._useless_s = 0.0 if samples_came else self._useless_s + waited_s
        self._seen_one = self._seen_one or samples_came
        period_s = self._arrivals.period_ns / 1e9
        silent_s = max(self._place.silent_s, 5 * period_s)
        if self._silent_s >= (silent_s if self._seen_one else max(_FIRST_S, silent_s)):
            raise DeviceLost(
                f"nothing comes from {self._place.name} for {self._silent_s:.1f} s: "
                "is the glove switched on and its cable plugged in?"
            )
        garbage_s = max(_GARBAGE_S if self._seen_one else _FIRST_S, 5 * period_s)
        if self._useless_s >= garbage_s and bytes_came:
            raise DeviceLost(
                f"what comes from {self._place.name} is not what a glove of kind {self.name} sends: is it "
                "another glove, another baud rate, or an option that does not fit?"
            )

    def _readings(self, samples: Sequence[Sample]) -> list[Reading]:
        """Give records that came together the times at which they were taken."""
        now_ns, offset_ns = clock_ns(), wall_ns() - clock_ns()
        readings = []
        for stamp, sample in zip(self._arrivals.of(len(samples), now_ns), samples, strict=True):
            if self._own_clock is not None and sample.ticks is not None:
                self._own_clock.note(sample.ticks, now_ns)
            if self._clock is not None and sample.ticks is not None:
                stamp = self._clock.monotonic_ns(sample.ticks, now_ns)
            self._last_ns = max(stamp, self._last_ns + 1)
            readings.append(
                Reading(
                    np.array(sample.values, np.float32),
                    self._last_ns,
                    self._last_ns + offset_ns,
                    np.array(sample.context, np.float32),
                    sample.button,
                )
            )
        return readings
