"""What is said to a CyberGlove III before it streams: commands that it echoes and ends with NUL.

Source: the vendor's manual and three public drivers, as collected in the project's fact sheet. Echoes are
seen to lose bytes, so a command counts as done when a NUL comes; the echo itself is not demanded.
"""

from __future__ import annotations

import re
import time
from dataclasses import dataclass

from glovecal_client.capture.stream.links import Link
from glovecal_client.errors import DeviceLost

STOP = b"\x03"
START = b"1S"
_REPLY_S = 0.5
_TRIES = 3
_QUIET_S = 0.1
_NUL, _LINE_FEED = re.compile(rb"\0\Z"), re.compile(rb"\n\Z")
_VOLTAGE = re.compile(rb"([0-9]{4,5})\s*Volts")


@dataclass(frozen=True)
class Reply:
    """What came after a command, up to the NUL that ends it."""

    heard: bytes
    echoed: bool
    """Whether the command came back whole."""


def command(link: Link, sent: bytes) -> Reply:
    """Give a command. Raises DeviceLost when nothing ended with NUL comes back, three times."""
    heard = question(link, sent, _NUL)
    if heard.endswith(b"\0"):
        return Reply(heard, sent in heard)
    raise DeviceLost(f"the glove does not answer {sent!r}; heard {heard[:24]!r}. Is it a CyberGlove III?")


def quiet(link: Link) -> None:
    """End a stream that an earlier program may have left, and read until nothing comes."""
    link.write(STOP)
    deadline = time.monotonic() + 1.0
    while link.read(_QUIET_S) and time.monotonic() < deadline:
        pass


def battery_volts(link: Link) -> float | None:
    """The battery's voltage; None if the glove does not tell. Its answer says Volts and means millivolts."""
    found = _VOLTAGE.search(question(link, b"V", _LINE_FEED))
    link.read(_QUIET_S)  # a NUL may follow, in one source it does not
    return None if found is None else int(found[1]) / 1000


def question(link: Link, sent: bytes, end: re.Pattern[bytes]) -> bytes:
    """The answer to what may be said twice: asked up to three times until it comes.

    What a late answer left on the way is read away first: it would be taken for that of the next question.
    """
    heard = b""
    for _ in range(_TRIES):
        heard = ask(link, sent, end)
        if end.search(heard):
            break
        quiet(link)
    return heard


def ask(link: Link, sent: bytes, end: re.Pattern[bytes]) -> bytes:
    """Send, and read until ``end`` is found or the time for a reply is over."""
    link.write(sent)
    deadline, heard = time.monotonic() + _REPLY_S, b""
    while end.search(heard) is None and (left_s := deadline - time.monotonic()) > 0:
        heard += link.read(left_s)
    return heard
