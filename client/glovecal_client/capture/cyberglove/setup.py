"""Setting a control box up for streaming, whatever an earlier program left behind in it."""

from __future__ import annotations

from dataclasses import dataclass

from glovecal_client.capture.cyberglove.box import ControlBox, Unanswered
from glovecal_client.capture.cyberglove.order import HARDWARE_MASK
from glovecal_client.capture.cyberglove.rate import (
    DEFAULT_RATE_HZ,
    period_payload,
    period_words,
    rate_of,
    too_fast_sentence,
    wire_ceiling_hz,
)
from glovecal_client.capture.cyberglove.record import RecordFormat
from glovecal_client.errors import BadOption


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
