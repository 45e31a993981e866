"""Text lines in a stream of bytes that may be damaged."""

from __future__ import annotations

from collections.abc import Callable

from glovecal_client.capture.stream.parser import Counters, Sample


class LineReader:
    """Cuts a stream into lines and has each parsed; what ``parse`` gives None for is counted as bad.

    The first line may have lost its beginning, which cannot be told from the line itself, so it is left out.
    Empty lines are nothing; a line longer than ``longest`` bytes is bad, and no more of it is kept.
    """

    def __init__(
        self, parse: Callable[[bytes], Sample | None], counters: Counters, *, longest: int = 512
    ) -> None:
        self._parse = parse
        self._counters = counters
        self._longest = longest
        self._rest = b""
        self._leaving_out = True
        """Until the next line feed: the cut first line, or the rest of one that is too long."""

    def feed(self, data: bytes) -> list[Sample]:
        """The samples of the lines completed by ``data``."""
        *lines, rest = (self._rest + data).split(b"\n")
        samples = []
        for line in lines:
            if self._leaving_out:
                self._leaving_out = False
                self._counters.skipped_bytes += len(line) + 1
            elif text := line.strip(b"\r "):
                sample = self._parse(text) if len(text) <= self._longest else None
                if sample is None:
                    self._counters.bad_frames += 1
                    self._counters.skipped_bytes += len(line) + 1
                else:
                    samples.append(sample)
        if len(rest) > self._longest:
            self._counters.bad_frames += not self._leaving_out
            self._counters.skipped_bytes += len(rest)
            self._leaving_out, rest = True, b""
        self._rest = rest
        return samples


def whole_number(text: bytes, most: int) -> int | None:
    """The number from 0 to ``most`` written as digits without leading zeros, None for anything else.

    A microcontroller prints no leading zeros; a line that was pieced together often has one.
    """
    if not text.isdigit() or len(text) > 9 or (text[0] == ord("0") and len(text) > 1):
        return None
    number = int(text)
    return number if number <= most else None
