"""Why a port gave no CyberGlove: a sentence from what was heard there at each baud rate."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

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
    if all(item.came == item.sent for item in noisy):
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
