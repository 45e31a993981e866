"""The alpha encoding of LucidGloves: letters that name a value, digits behind them, one line a sample.

Source: LucidVR/lucidgloves 76472c7 (firmware) and LucidVR/opengloves-driver a462ff6 (its reader), as
collected in the project's fact sheet. There is no checksum: a digit lost inside a number gives another
number, which cannot be told from a reading. Everything else that is damaged is told by the form of the
line.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from glovecal_client.capture.stream.lines import whole_number
from glovecal_client.capture.stream.parser import Sample

_FIELD = re.compile(rb"(\([A-Z]{1,3}\)|[A-Z])([0-9]*)")
_FINGERS = b"ABCDE"
_ANALOG = frozenset(bytes([key]) for key in b"ABCDEFGP")
_FLAGS = frozenset(bytes([key]) for key in b"HIJKLMNO")
_FOREIGN_DIGITS = 10
_FINGER_OF_NAME = dict(zip("TIMRP", "ABCDE", strict=True))
KEYS: dict[str, dict[str, str]] = {
    "flexion": {f"{name}_FLEX": finger for name, finger in _FINGER_OF_NAME.items()},
    "splay": {f"{name}_SPLAY": f"({finger}B)" for name, finger in _FINGER_OF_NAME.items()},
    "joints": {
        f"{name}_JOINT{number}": f"({finger}A{joint})"
        for name, finger in _FINGER_OF_NAME.items()
        for number, joint in enumerate("ABCD", 1)
    },
}
"""What a line may hold, by the option ``sensors``: name of the sensor -> key on the line."""
_BUTTON = b"J"
"""Button A."""


class AlphaLine:
    """Reads the sensors behind ``keys``; ``largest`` is the largest count the glove can send."""

    def __init__(self, keys: Sequence[str], largest: int) -> None:
        self._keys = [key.encode("ascii") for key in keys]
        self._largest = largest

    def __call__(self, line: bytes) -> Sample | None:
        """The sample of a line, None if it is damaged: an unreadable place, a key twice, a value too large.

        Keys that no sensor is behind are passed over, as the OpenGloves driver does: newer firmware may send
        more.
        """
        found: dict[bytes, int] = {}
        at = 0
        while at < len(line):
            field = _FIELD.match(line, at)
            if field is None or field[1] in found or not self._possible(field[1], field[2]):
                return None
            found[field[1]] = int(field[2] or 0)
            at = field.end()
        if any(key not in found for key in self._keys):
            return None
        return Sample(tuple(found[key] for key in self._keys), button=_BUTTON in found)

    def _possible(self, key: bytes, digits: bytes) -> bool:
        """Whether a key may have these digits: a flag none, an analog value a count, a foreign key any."""
        if key in _FLAGS:
            return not digits
        if key in _ANALOG or (len(key) > 2 and key[1:2] in _FINGERS):
            return whole_number(digits, self._largest) is not None
        return len(digits) < _FOREIGN_DIGITS
