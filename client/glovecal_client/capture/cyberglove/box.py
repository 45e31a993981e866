"""The conversation with a CyberGlove I/II control box: binary commands and queries over a serial link.

A command is one upper-case letter and its payload, answered ``letter NUL``; a query is ``?`` and a letter,
answered ``? letter payload NUL``. Payloads may hold zeros, so answers are read by their fixed length and
never up to the NUL. The CyberGlove III echoes the payload of a command as well, which is accepted.
"""

from __future__ import annotations

import time

from glovecal_client.capture.serial_link import SerialLink
from glovecal_client.errors import DeviceError

STOP = b"\x03"
RESTART = b"\x12"
_REPLY_S = 1.0
_TRIES = 3
_PAUSE_S = 0.15
"""Silence that ends an answer of unknown length."""


class Unanswered(DeviceError):
    """The box did not answer as expected. ``heard`` is what came instead, ``refused`` its error letters."""

    def __init__(self, command: bytes, heard: bytes, refused: str = "") -> None:
        name = command.decode("ascii", "backslashreplace")
        what = f"refused ({refused})" if refused else f"not answered; heard {heard[:24]!r}"
        super().__init__(f"the control box's command {name!r} was {what}")
        self.heard = heard
        self.refused = refused


class ControlBox:
    """Asks and sets over ``link``. The box must not be streaming, except for ``stop`` and ``stream``."""

    def __init__(self, link: SerialLink) -> None:
        self.link = link

    def stop(self) -> bytes:
        """End a stream that an earlier program may have left, and read until the line is quiet.

        Sources disagree whether the answer is one byte or two, so it is not waited for.
        """
        self.link.write(STOP)
        return self.link.drain(quiet_s=0.05, at_most_s=0.4)

    def stream(self) -> None:
        """Start the stream of samples."""
        self.link.flush_both_ways()
        self.link.write(b"S")

    def query(self, letter: str, length: int, *, reply_s: float = _REPLY_S, tries: int = _TRIES) -> bytes:
        """The payload, ``length`` bytes, of the answer to ``?letter``. Raises Unanswered, DeviceLost."""
        question = b"?" + letter.encode("ascii")
        heard = b""
        for _ in range(tries):
            answer, heard = self._ask(question, question, length + 1, reply_s)
            if answer is not None and answer[-1] == 0:
                return answer[:-1]
        raise Unanswered(question, heard, _refusal(heard))

    def query_text(self, letter: str) -> str:
        """A text answer such as that of ``i``, which only exists in lower case; empty if there is none."""
        self.link.flush_both_ways()
        self.link.write(letter.encode("ascii"))
        deadline, heard = time.monotonic() + _REPLY_S, b""
        while time.monotonic() < deadline and b"\0" not in heard:
            heard += self.link.read(_PAUSE_S)
        text = heard.split(b"\0", 1)[0].decode("ascii", "replace")
        return "" if text.startswith("e?") else text.removeprefix(letter).strip()

    def set(self, letter: str, payload: bytes) -> None:
        """Give a command. Raises Unanswered, DeviceLost."""
        command, name = letter.encode("ascii") + payload, letter.encode("ascii")
        heard = b""
        for _ in range(_TRIES):
            answer, heard = self._ask(command, name, 1, _REPLY_S)
            if answer == b"\0" or (payload and heard.endswith(command + b"\0")):
                return
            if refusal := _refusal(heard):
                raise Unanswered(name, heard, refusal)
        raise Unanswered(name, heard)

    def restart(self) -> bytes:
        """Restart the firmware: 1.75 s of silence, then an answer sources disagree on; returns what came."""
        self.link.write(RESTART)
        heard = self.link.read(2.4)
        return heard + self.link.drain(quiet_s=_PAUSE_S, at_most_s=0.5)

    def _ask(self, command: bytes, echo: bytes, length: int, reply_s: float) -> tuple[bytes | None, bytes]:
        """Send ``command``; the ``length`` bytes after ``echo`` (None: not in time), and all that came."""
        self.link.flush_both_ways()
        self.link.write(command)
        deadline, heard = time.monotonic() + reply_s, b""
        while True:
            at = heard.find(echo)
            if at >= 0 and len(heard) >= at + len(echo) + length:
                start = at + len(echo)
                return heard[start : start + length], heard
            if _refusal(heard) or (left := deadline - time.monotonic()) <= 0:
                return None, heard
            heard += self.link.read(min(left, _PAUSE_S))


def _refusal(heard: bytes) -> str:
    """The letter of an error answer (``e?`` unknown, ``en`` numbers, ``eg``, ``es``, ``ey``), or nothing.

    The CyberGlove III's manual puts a blank before and CR LF behind it.
    """
    text = heard.strip(b" \r\n\0")
    if (
        len(text) == 2
        and text[:1] == b"e"
        and text[1:] in (b"?", b"n", b"y", b"g", b"s")
        and heard[-1:] == b"\0"
    ):
        return text.decode("ascii")
    return ""
