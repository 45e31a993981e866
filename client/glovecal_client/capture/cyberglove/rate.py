"""Sample rates of a CyberGlove: the box's two period words, and what the wire can carry."""

from __future__ import annotations

from glovecal_client.capture.cyberglove.record import RecordFormat

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
