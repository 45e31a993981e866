"""Setting a control box up for streaming: the options of the device, sample rates, and what the box is told.

Whatever an earlier program left behind in the box is set anew. A rate is two period words of the box, and no
more than the wire can carry.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

from glovecal_client.capture.cyberglove.box import ControlBox, Unanswered
from glovecal_client.capture.cyberglove.connection import BAUD_RATES
from glovecal_client.capture.cyberglove.identity import HARDWARE_MASK, SENSORS
from glovecal_client.capture.cyberglove.record import RecordFormat
from glovecal_client.capture.device import check_options
from glovecal_client.errors import BadOption

DEFAULT_RATE_HZ = 100.0
SLOWEST_HZ = 0.5
FASTEST_HZ = 1000.0
_CLOCK_HZ = 115200
_BITS_PER_BYTE = 10
"""8 data bits with a start and a stop bit."""


def period_words(rate_hz: float) -> tuple[int, int]:
    """Words w1, w2 for the period w1 * w2 / 115200 s nearest to the rate; 1152, 1 for 100 Hz.

    A word of 0 would mean "as fast as possible" and is never given.
    """
    ticks = max(1, round(_CLOCK_HZ / rate_hz))
    second = -(-ticks // 0xFFFF)
    return max(1, round(ticks / second)), second


def rate_of(words: tuple[int, int]) -> float:
    """The rate in Hz that two period words give."""
    return _CLOCK_HZ / (words[0] * words[1])


def period_payload(words: tuple[int, int]) -> bytes:
    """The four bytes of the command T: both words, high byte first."""
    return words[0].to_bytes(2, "big") + words[1].to_bytes(2, "big")


def wire_ceiling_hz(baud: int, record_format: RecordFormat) -> float:
    """Records per second that fit through the wire: 480 for 24 bytes at 115200 baud."""
    return baud / _BITS_PER_BYTE / record_format.length


def too_fast_sentence(rate_hz: float, baud: int, record_format: RecordFormat) -> str:
    """Why a rate cannot be had, and what can."""
    ceiling = wire_ceiling_hz(baud, record_format)
    stamp = " Leaving out the time stamp saves 5 bytes a record." if record_format.timestamp else ""
    return (
        f"{rate_hz:g} Hz is not reachable: a record of {record_format.length} bytes at {baud} baud "
        f"leaves room for {ceiling:.0f} Hz at most.{stamp}"
    )


_Value = TypeVar("_Value")
OPTION_HELP = {
    "baud": f"auto|{'|'.join(map(str, BAUD_RATES))} (auto)",
    "rate": f"HZ, {SLOWEST_HZ:g} to {FASTEST_HZ:g} (100, or what the baud rate carries)",
    "layout": f"auto|{'|'.join(SENSORS)} (auto)",
    "timestamp": "on|off (off)",
}


@dataclass(frozen=True)
class CyberGloveOptions:
    """How a CyberGlove is to be run; None leaves the choice to the glove and the wire."""

    baud: int | None = None
    rate_hz: float | None = None
    layout: str | None = None
    timestamp: bool = False

    @classmethod
    def parse(cls, options: Mapping[str, str]) -> CyberGloveOptions:
        """From ``baud=auto|115200|...``, ``rate=HZ``, ``layout=auto|cyberglove18|...``, ``timestamp=on|off``.

        Raises BadOption.
        """
        check_options("cyberglove", options, OPTION_HELP)
        return cls(
            baud=_choice(options, "baud", {"auto": None, **{str(rate): rate for rate in BAUD_RATES}}),
            rate_hz=_rate(options["rate"]) if "rate" in options else None,
            layout=_choice(options, "layout", {"auto": None, **{name: name for name in SENSORS}}),
            timestamp=_choice(options, "timestamp", {"off": False, "on": True}),
        )


def _rate(text: str) -> float:
    try:
        rate = float(text)
    except ValueError:
        rate = float("nan")
    if not SLOWEST_HZ <= rate <= FASTEST_HZ:
        raise BadOption(f"rate must be a number of Hz from {SLOWEST_HZ:g} to {FASTEST_HZ:g}, not {text!r}")
    return rate


def _choice(options: Mapping[str, str], key: str, choices: Mapping[str, _Value]) -> _Value:
    """The value an option's text stands for; the first choice when it is not given."""
    text = options.get(key, next(iter(choices)))
    if text not in choices:
        raise BadOption(f"{key} must be one of {', '.join(choices)}, not {text!r}")
    return choices[text]


@dataclass(frozen=True)
class StreamSetup:
    """What the box will send, how often, and what is not as asked for (a sentence, else empty)."""

    record_format: RecordFormat
    rate_hz: float
    notice: str


def set_up(box: ControlBox, sensors: int, asked_rate_hz: float | None, timestamp: bool) -> StreamSetup:
    """All sensors, plain values, status byte, time stamp as asked, period.

    Raises BadOption when the asked rate does not fit through the wire; without one, 100 Hz is lowered to fit.
    """
    mask = HARDWARE_MASK[sensors].to_bytes(3, "little")
    if box.query("M", 3) != mask:
        box.set("M", mask)
    if box.query("N", 1)[0] != sensors:
        box.set("N", bytes([sensors]))
    for letter in "QY":  # quantised values and external sync
        _switch(box, letter, False)
    record_format = RecordFormat(
        sensors, timestamp=_switch(box, "D", timestamp), status=_switch(box, "U", True)
    )
    rate_hz, notice = _reachable(asked_rate_hz, box.link.baud, record_format)
    words = period_words(rate_hz)
    box.set("T", period_payload(words))
    return StreamSetup(record_format, rate_of(words), notice)


def _reachable(asked_hz: float | None, baud: int, record_format: RecordFormat) -> tuple[float, str]:
    ceiling = wire_ceiling_hz(baud, record_format)
    wanted = asked_hz or DEFAULT_RATE_HZ
    if wanted <= ceiling:
        return wanted, ""
    sentence = too_fast_sentence(wanted, baud, record_format)
    if asked_hz is not None:
        raise BadOption(sentence)
    lower = float(int(ceiling * 0.95))
    return lower, f"{sentence} Streaming at {lower:g} Hz."


def _switch(box: ControlBox, letter: str, on: bool) -> bool:
    """Set a flag if it is not so already and say how it stands; a box that does not know it has it off."""
    try:
        if bool(box.query(letter, 1)[0]) != on:
            box.set(letter, bytes([on]))
    except Unanswered as error:
        if not error.refused:
            raise
        return False
    return on
