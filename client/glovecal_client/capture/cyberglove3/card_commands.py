"""What a CyberGlove III can be asked beside its stream: battery, clock, and recordings on its memory card.

Krnoul et al. 2016 (section 3.1): voltage, internal time, active file, list of files, start and stop. The
replies are described by the vendor's manual alone; the header text that a new file wants is its name.
"""

from __future__ import annotations

import re
from typing import Any

from glovecal_client.capture.cyberglove3.clock_poll import ClockReading, read_clock, set_clock
from glovecal_client.capture.cyberglove3.conversation import ask, battery_volts, command, question, quiet
from glovecal_client.capture.stream.links import Link
from glovecal_client.errors import BadOption, DeviceLost
from glovecal_client.names import did_you_mean

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
