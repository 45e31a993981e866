"""What a trigger says, whichever protocol it came by, and what each protocol has to be able to do."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
from typing import Literal, Protocol

from glovecal_models.errors import GlovecalError

LONGEST_NAME = 100
LONGEST_FIELD = 500
_NOT_IN_FILE_NAMES = re.compile(r'[<>:"/\\|?*]')
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029]")
NAMELESS = "take"


class UnknownPacket(GlovecalError):
    """The packet is none of the protocol's; the sentence says why."""


@dataclass(frozen=True)
class Trigger:
    """Begin or end a recording. Texts are as they were sent, "" where nothing was."""

    action: Literal["start", "stop"]
    name: str = ""
    packet_id: str = ""
    notes: str = ""
    description: str = ""
    time_code: str = ""
    result: str = ""
    """Of a stop: SUCCESS, FAIL or CANCEL."""
    delay_s: float = 0.0
    """From the packet to what it speaks of."""


@dataclass(frozen=True)
class Request:
    """What one packet asks for, and the bytes to answer with; b"" for no answer."""

    trigger: Trigger | None
    """None: it is understood, and begins or ends nothing."""
    when_done: bytes = b""
    when_refused: bytes = b""
    answer_port: int | None = None
    """Of the sender; None: the one it sent from."""


class Reader(Protocol):
    """One listening socket's; it may remember earlier packets."""

    def read(self, packet: bytes) -> Request:
        """Raises UnknownPacket."""
        ...


def one_line(text: str, longest: int = LONGEST_FIELD) -> str:
    """``text`` without control characters, cut to ``longest``."""
    cleaned = text.encode("utf-8", "replace").decode("utf-8")
    return " ".join(_CONTROL.sub(" ", cleaned).split())[:longest]


def safe_name(name: str) -> str:
    """``name`` as a take can have it and a file on any system could be called."""
    cleaned = one_line(unicodedata.normalize("NFC", name), LONGEST_NAME)
    return _NOT_IN_FILE_NAMES.sub("_", cleaned).strip(" .") or NAMELESS
