"""The older encoding of LucidGloves: thirteen numbers joined by ``&``, one line a sample.

Five fingers, joystick x and y, then joystick click, trigger, A, B, grab and pinch as 0 or 1. Source as for
the alpha encoding; no checksum either.
"""

from __future__ import annotations

from glovecal_client.capture.stream.lines import whole_number
from glovecal_client.capture.stream.parser import Sample

_FIELDS = 13
_ANALOG = 7
_BUTTON = 9
"""Button A."""


class LegacyLine:
    """Reads the five fingers; ``largest`` is the largest count the glove can send."""

    def __init__(self, largest: int) -> None:
        self._largest = largest

    def __call__(self, line: bytes) -> Sample | None:
        """The sample of a line, None if it is not thirteen numbers in their ranges."""
        fields = line.split(b"&")
        if len(fields) != _FIELDS:
            return None
        numbers = []
        for place, text in enumerate(fields):
            number = whole_number(text, self._largest if place < _ANALOG else 1)
            if number is None:
                return None
            numbers.append(number)
        return Sample(tuple(numbers[:5]), button=bool(numbers[_BUTTON]))
