"""Text lines in a stream of bytes that may be damaged."""

from __future__ import annotations

import re
from collections.abc import Callable

from glovecal_client.capture.stream.parser import BadRecord, Counters, Sample


class LineReader:
    """Cuts a stream into lines and has each parsed; a line that raises BadRecord is counted and kept to show.

    ``parse`` gives None for a line that is a part of a sample and not its last. ``end``: the byte that ends a
    line; a carriage return before a line feed is nothing. The first line may have lost its beginning, which
    cannot be told from the line itself, so it is left out. Empty lines are nothing; a line longer than
    ``longest`` bytes is bad, and no more of it is kept.
    """

    def __init__(
        self,
        parse: Callable[[bytes], Sample | None],
        counters: Counters,
        *,
        longest: int = 512,
        end: bytes = b"\n",
    ) -> None:
        self._parse = parse
        self._counters = counters
        self._longest = longest
        self._end = end
        self._rest = b""
        self._leaving_out = True
        """Until the next end of a line: the cut first line, or the rest of one that is too long."""

    def feed(self, data: bytes) -> list[Sample]:
        """The samples of the lines completed by ``data``."""
        *lines, rest = (self._rest + data).split(self._end)
        samples = []
        for line in lines:
            if self._leaving_out:
                self._leaving_out = False
                self._counters.skipped_bytes += len(line) + 1
            elif text := line.strip(b"\r "):
                try:
                    if (sample := self._sample(text)) is not None:
                        samples.append(sample)
                except BadRecord as bad:
                    self._counters.refuse(text, str(bad))
                    self._counters.skipped_bytes += len(line) + 1
        if len(rest) > self._longest:
            if not self._leaving_out:
                self._counters.refuse(rest, self._too_long())
            self._counters.skipped_bytes += len(rest)
            self._leaving_out, rest = True, b""
        self._rest = rest
        return samples

    def _sample(self, text: bytes) -> Sample | None:
        if len(text) > self._longest:
            raise BadRecord(self._too_long())
        return self._parse(text)

    def _too_long(self) -> str:
        hint = " (each ends with a carriage return alone?)" if self._end == b"\n" else ""
        return f"no line is longer than {self._longest} bytes{hint}"


_DIGITS = re.compile(rb"0|[1-9][0-9]{0,18}")


def whole_number(text: bytes, most: int | None, name: str) -> int:
    """The number from 0 to ``most`` written as digits without leading zeros. Raises BadRecord with ``name``.

    A microcontroller prints no leading zeros; a line that was pieced together often has one. ``most`` None:
    whatever 64 bits hold.
    """
    if not _DIGITS.fullmatch(text):
        raise BadRecord(f"{name} is {text.decode('ascii', 'backslashreplace')!r}, not a whole number")
    number = int(text)
    if most is not None and number > most:
        raise BadRecord(f"{name} is {number}, above {most}")
    return number
