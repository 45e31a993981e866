"""What a CyberGlove III can be asked and told: set-up, clock, battery and memory card.

Sources: the vendor's manual and three public drivers, as collected in the project's fact sheet; Krnoul et al.
2016, section 3.1 (voltage, internal time, active file, list of files, start and stop). A command is echoed
and ends with NUL. Echoes are seen to lose bytes, so it counts as done when a NUL comes; the echo itself is
not demanded. The replies about the card are described by the vendor's manual alone; the header text that a
new file wants is its name.

The internal clock is set and measured by asking it: ``1tg`` tells whole frames of 1/30 s only. Each answer
bounds the clock from both sides: when the question left it had not passed the frame's end, and when the
answer came it had reached the frame's beginning. Many answers at other phases of a frame bound it far below
one frame; asking ends when that is so.
"""

from __future__ import annotations

import re
import time
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from glovecal_client.capture.stream.links import Link
from glovecal_client.clock import wall_ns
from glovecal_client.errors import BadOption, DeviceLost
from glovecal_client.keys import did_you_mean

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


WANTED_S = 0.004
"""Half of the interval that the offset lies in: asking goes on until it is that short."""
MOST_S = 3.0
MOST_SETTINGS = 5
DAY_S = 86400.0
_SAID = re.compile(rb"([0-2][0-9]):([0-5][0-9]):([0-5][0-9]):([0-9]{2})")


@dataclass(frozen=True)
class ClockReading:
    """The glove's clock less the computer's wall clock of the day, in seconds."""

    ahead_s: float
    half_width_s: float
    """The offset lies within this of ``ahead_s``, for certain while both clocks drift slowly."""
    polls: int
    wall_s: float
    """When: the computer's wall clock, seconds since 1970."""
    is_consistent: bool
    """False: the answers contradict each other, the clock jumps or counts no frames."""

    @property
    def sd_s(self) -> float:
        """Of an even distribution over the interval."""
        return self.half_width_s / 3**0.5


def read_clock(link: Link, frame_rate: float, wanted_s: float = WANTED_S) -> ClockReading:
    """Ask until the offset is known to ``wanted_s``, three seconds at most. Raises DeviceLost."""
    frame_s, low, high, polls, frames_seen = 1.0 / frame_rate, -DAY_S, DAY_S, 0, set()
    second_low, second_high, consistent = -DAY_S, DAY_S, True
    begun = time.monotonic()
    while True:
        sent_s = wall_of_day_s()  # of an answer to a repeated question the bound is wider, never wrong
        heard = question(link, b"1tg", _SAID)
        got_s = wall_of_day_s()
        found = _SAID.search(heard)
        if found is None:
            raise DeviceLost(f"the glove does not tell its time; heard {heard[:24]!r} after 1tg")
        hour, minute, second, frame = (int(part) for part in found.groups())
        said_s, polls = 3600 * hour + 60 * minute + second, polls + 1
        frames_seen.add(frame)
        at_s = said_s + frame * frame_s
        low, high = max(low, nearest_s(at_s - got_s)), min(high, nearest_s(at_s + frame_s - sent_s))
        second_low = max(second_low, nearest_s(said_s - got_s))
        second_high = min(second_high, nearest_s(said_s + 1 - sent_s))
        is_out = time.monotonic() - begun > MOST_S
        if high < low or (is_out and frames_seen == {0}):
            # frames are not counted, or not as stated: whole seconds are all that can be used
            low, high, consistent = second_low, second_high, second_high >= second_low
            is_out = True
        if is_out or (high - low <= 2 * wanted_s and polls > 1):
            return ClockReading((low + high) / 2, max(0.0, high - low) / 2, polls, time.time(), consistent)
        time.sleep(0.37 * frame_s)


def set_clock(link: Link, frame_rate: float, wanted_s: float | None = None) -> tuple[ClockReading, int]:
    """Set the clock to the computer's, until they differ by less than ``wanted_s`` (a frame); how often.

    Only whole seconds can be set, so the command leaves when a second begins. Raises DeviceLost.
    """
    wanted_s = 1.0 / frame_rate if wanted_s is None else wanted_s
    early_s, reading = 0.0, None
    for times in range(1, MOST_SETTINGS + 1):
        at_s = wall_of_day_s()
        second = int(at_s + 1.05 + early_s)
        time.sleep(max(0.0, second - early_s - wall_of_day_s()))
        second %= int(DAY_S)
        command(link, f"1ts{second // 3600:02}:{second // 60 % 60:02}:{second % 60:02}".encode())
        reading = read_clock(link, frame_rate)
        if abs(reading.ahead_s) <= wanted_s:
            return reading, times
        early_s = min(0.5, max(0.0, early_s - reading.ahead_s))
    assert reading is not None
    return reading, MOST_SETTINGS


def wall_of_day_s() -> float:
    """Seconds since local midnight by the computer's wall clock."""
    now = datetime.fromtimestamp(wall_ns() / 1e9)
    return 3600 * now.hour + 60 * now.minute + now.second + now.microsecond / 1e6


def nearest_s(difference_s: float) -> float:
    """Of two clocks that begin anew each day."""
    return (difference_s + DAY_S / 2) % DAY_S - DAY_S / 2


COMMANDS = {
    "status": "battery, clock, active file, files and free space",
    "set-clock": "set the clock to the computer's",
    "start": "record on the card, into the file that is named",
    "stop": "end the recording on the card",
}
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,7}(\.[A-Za-z0-9]{1,3})?")
"""Names as a card of its time takes them: 8.3."""
_WHOLE_ECHO_TRIES = 5
_TEXT_END = re.compile(rb"\0\Z")
_OPENED = re.compile(rb"[\0\x01]\Z")
_FREE = re.compile(rb"([0-9]+)MB left")


def run_command(link: Link, name: str, argument: str, frame_rate: float) -> dict[str, Any]:
    """Carry out one of ``COMMANDS`` on a glove that does not stream now. Raises DeviceLost, BadOption."""
    if name not in COMMANDS:
        raise BadOption(f"no command {name!r}; {did_you_mean(name, COMMANDS)}")
    quiet(link)
    if name == "start":
        _open_file(link, argument)
        command(link, b"1es")
        return {
            "active_file": argument,
            "recording": True,
            "clock": clock_document(read_clock(link, frame_rate)),
        }
    if name == "stop":
        command(link, b"1ds")
        return {"recording": False, **status(link, frame_rate)}
    if name == "set-clock":
        reading, times = set_clock(link, frame_rate)
        return {"clock": clock_document(reading), "times_set": times}
    return status(link, frame_rate)


def status(link: Link, frame_rate: float) -> dict[str, Any]:
    """Battery in V, the clock against the computer's, active file, files, free space in MB."""
    volts = battery_volts(link)
    files = [line.strip() for line in _text(link, b"?l").splitlines() if line.strip()]
    free = _FREE.search(question(link, b"?I", _TEXT_END))
    return {
        "battery_v": volts,
        "active_file": _text(link, b"?A").strip() or None,
        "files": files,
        "free_mb": None if free is None else int(free[1]),
        "clock": clock_document(read_clock(link, frame_rate)),
    }


def clock_document(reading: ClockReading) -> dict[str, Any]:
    """Seconds; ``ahead_s`` is the glove's clock less the computer's of the day."""
    return {
        "ahead_s": round(reading.ahead_s, 6), "half_width_s": round(reading.half_width_s, 6),
        "sd_s": round(reading.sd_s, 6), "polls": reading.polls, "wall_s": reading.wall_s,
        "is_consistent": reading.is_consistent,
    }  # fmt: skip


def _open_file(link: Link, name: str) -> None:
    """Make ``name`` the active file; a new one gets its name as header text."""
    if not _NAME.fullmatch(name):
        raise BadOption(f"card file {name!r} must have up to 8 letters, digits, - or _, such as MONDAY.DAT")
    heard = ask(link, b"1A" + name.encode() + b"\x01", _OPENED)
    if heard.endswith(b"\0"):
        ask(link, name.encode() + b"\x01", _OPENED)
    elif not heard.endswith(b"\x01"):
        raise DeviceLost(
            f"the glove does not open {name!r} on its card; heard {heard[-24:]!r}. Is a card in it?"
        )
    if (active := _text(link, b"?A").strip()) != name:
        raise DeviceLost(f"the glove says its active file is {active!r}, not {name!r}; ask again")


def _text(link: Link, query: bytes) -> str:
    """What a query answers, without its echo and the NUL. Raises DeviceLost when no echo comes whole.

    What is left of an echo that lost a byte cannot be told from the beginning of a file's name.
    """
    heard = b""
    for _ in range(_WHOLE_ECHO_TRIES):
        heard = question(link, query, _TEXT_END)
        if heard.startswith(query):
            return heard[len(query) :].rstrip(b"\0").decode("latin-1")
    raise DeviceLost(
        f"the glove answers {query!r} with {heard[:24]!r}, whose beginning is damaged each time: check its "
        "cable or WiFi"
    )
