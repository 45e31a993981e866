"""Finding the CyberGlove control box behind a port: the baud rate it speaks, or why it is none."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from glovecal_client.capture.cyberglove.box import RESTART, STOP, ControlBox, Unanswered
from glovecal_client.capture.cyberglove.identity import LAYOUT_OF_COUNT
from glovecal_client.capture.serial_link import SerialLink
from glovecal_client.errors import DeviceError, DeviceLost

Kind = Literal["silent", "echo", "text", "unreadable"]

_FLEX_GLOVE_LINE = re.compile(rb"A\d+B\d+C\d+D\d+E\d+")
_CYBERGLOVE3_RECORD = re.compile(rb"\d\d:\d\d:\d\d:\d\d:\dS", re.DOTALL)


@dataclass(frozen=True)
class Heard:
    """What one port said at one rate: the bytes sent to it and the bytes that came."""

    baud: int
    sent: bytes
    came: bytes


def kind_of(tries: Sequence[Heard]) -> Kind:
    """The likeliest explanation of several tries at one port, none of which found a glove."""
    noisy = [item for item in tries if item.came]
    if not noisy:
        return "silent"
    if all(item.came in 8 * item.sent for item in noisy):  # of a try before, where the port is slow
        return "echo"
    if any(_is_text(item.came) for item in noisy):
        return "text"
    return "unreadable"


def explain(path: str, tries: Sequence[Heard]) -> str:
    """One sentence or two: what was heard, its likely cause, and what to do."""
    rates = ", ".join(str(rate) for rate in dict.fromkeys(item.baud for item in tries)) + " baud"
    kind = kind_of(tries)
    if kind == "silent":
        return (
            f"nothing answers on {path} at {rates}: is the control box switched on, "
            "and is this the port its cable goes to?"
        )
    if kind == "echo":
        return f"{path} sends back what is written to it: a loop-back plug or a terminal, not a CyberGlove"
    if kind == "text":
        return _explain_text(path, next(item for item in tries if _is_text(item.came)))
    if len({item.baud for item in tries}) == 1:
        return (
            f"{path} answers with unreadable bytes at {rates}: most likely the baud rate is wrong "
            "(leave out the option baud to try all of them), else this is another device"
        )
    return (
        f"{path} sends bytes that are no CyberGlove's at any of {rates}: most likely another device, "
        "else a box set to a rate outside this list"
    )


def _explain_text(path: str, item: Heard) -> str:
    if _FLEX_GLOVE_LINE.search(item.came):
        return (
            f"{path} sends LucidGlove lines at {item.baud} baud: a home-made flex glove; "
            f"capture it with --device lucidglove:{path}"
        )
    if _CYBERGLOVE3_RECORD.search(item.came):
        return (
            f"{path} sends time-stamped 16-bit records: a CyberGlove III left streaming in its own mode; "
            f"capture it with --device cyberglove3:{path}, or switch it off and on again"
        )
    lines = [line.strip() for line in item.came.splitlines() if line.strip()]
    sample = max(lines, key=len)[:40].decode("ascii", "replace")
    return f"{path} is another device: at {item.baud} baud it sends text such as {sample!r}"


def _is_text(data: bytes) -> bool:
    if _CYBERGLOVE3_RECORD.search(data):
        return True
    readable = sum(32 <= value < 127 or value in (9, 10, 13) for value in data)
    return len(data) >= 8 and readable >= 0.95 * len(data)


BAUD_RATES = (115200, 38400, 19200, 9600)
"""Every driver since about 2000 uses the first, older ones the others."""
_QUESTION = b"?S"
_ANSWER_S = 0.5
_TRIES = 2
"""1 s in all: one driver gives the box that long after opening, another waits that long for an answer."""


@dataclass(frozen=True)
class Connection:
    """An open link to a box that has said how many sensors it has."""

    link: SerialLink
    box: ControlBox
    sensors: int


def connect(path: str, bauds: Sequence[int] = BAUD_RATES) -> Connection:
    """Open ``path`` at the first of ``bauds`` at which a CyberGlove answers.

    Takes at most about 8 s for four rates, the longest when all is silent. Raises DeviceLost when nothing
    answers or the port is gone, DeviceError when something else does; both name the likely cause.
    """
    tries: list[Heard] = []
    for baud in bauds:
        found, heard = _try(path, baud, greet=ControlBox.stop, greeting=STOP)
        if found is not None:
            return found
        tries.append(heard)
        if kind_of([heard]) in ("text", "echo"):
            break  # no wrong rate makes readable text, or gives back what was sent
    if kind_of(tries) != "silent":
        raise DeviceError(explain(path, tries))
    # A box whose firmware hangs listens to nothing but a restart.
    found, heard = _try(path, bauds[0], greet=ControlBox.restart, greeting=RESTART)
    if found is None:
        raise DeviceLost(explain(path, tries))
    return found


def _try(
    path: str, baud: int, *, greet: Callable[[ControlBox], bytes], greeting: bytes
) -> tuple[Connection | None, Heard]:
    """Greet and ask at one rate. The link stays open only when a box answered."""
    link = SerialLink(path, baud)
    box, sent, found = ControlBox(link), greeting, None
    try:
        came = greet(box)
        for _ in range(_TRIES):
            sent += _QUESTION
            sensors, heard = ask_sensors(box, _ANSWER_S)
            came += heard
            if sensors is not None:
                found = Connection(link, box, sensors)
                break
    finally:
        if found is None:
            link.close()
    return found, Heard(baud, sent, came)


def ask_sensors(box: ControlBox, reply_s: float) -> tuple[int | None, bytes]:
    """The number of sensors a box answers with, None if the answer is no box's; and what came."""
    try:
        sensors = box.query("S", 1, reply_s=reply_s, tries=1)[0]
    except Unanswered as error:
        return None, error.heard
    came = _QUESTION + bytes([sensors, 0])
    # 14 and 16 sensors were built too; identify() refuses them by name. Anything else is chance.
    return (sensors if sensors in (*LAYOUT_OF_COUNT, 14, 16) else None), came
