"""The older encoding of LucidGloves: thirteen numbers joined by ``&``, one line a sample.

Five fingers, joystick x and y, then joystick click, trigger, A, B, grab and pinch as 0 or 1. Source as for
the alpha encoding; no checksum either. Only the fingers are bounded: nothing else of a line is used but the
button.
"""

from __future__ import annotations

from glovecal_client.capture.stream.lines import whole_number
from glovecal_client.capture.stream.parser import BadRecord, Sample

_NAMES = (
    "thumb", "index", "middle", "ring", "pinky", "joystick x", "joystick y",
    "joystick click", "trigger", "A", "B", "grab", "pinch",
)  # fmt: skip
_FINGERS = 5
_ANALOG = 7
_BUTTON = 9
"""Button A."""


class LegacyLine:
    """Reads the five fingers; ``largest`` is the largest count a finger can have."""

    def __init__(self, largest: int) -> None:
        self._most = [largest] * _FINGERS + [None] * (_ANALOG - _FINGERS) + [1] * (len(_NAMES) - _ANALOG)

    def __call__(self, line: bytes) -> Sample:
        """The sample of a line. Raises BadRecord if it is not thirteen numbers in their ranges."""
        fields = line.split(b"&")
        if len(fields) != len(_NAMES):
            raise BadRecord(f"{len(fields)} fields, not {len(_NAMES)}: is encoding=legacy right?")
        numbers = [
            whole_number(text, most, name)
            for text, most, name in zip(fields, self._most, _NAMES, strict=True)
        ]
        return Sample(tuple(numbers[:_FINGERS]), button=bool(numbers[_BUTTON]))
