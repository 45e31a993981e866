"""The alpha encoding of LucidGloves: letters that name a value, digits behind them, one line a sample.

Source: LucidVR/lucidgloves 76472c7 (firmware) and LucidVR/opengloves-driver a462ff6 (its reader), as
collected in the project's fact sheet; senseshift/opengloves-lib (firmware) for what it leaves out. There is
no checksum: a digit lost inside a number gives another number, which cannot be told from a reading.
Everything else that is damaged is told by the form of the line.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from glovecal_client.capture.stream.lines import whole_number
from glovecal_client.capture.stream.parser import BadRecord, Sample, shown

_FIELD = re.compile(rb"(\([A-Z]{1,3}\)|[A-Z])([0-9]*)")
_FLAGS = frozenset(bytes([key]) for key in b"HIJKLMNO")
_NUMBERS = frozenset(bytes([key]) for key in b"ABCDEFGP")
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
_FIRST_JOINT = b"AA)"
_BUTTON = b"J"
"""Button A."""


class AlphaLine:
    """Reads the sensors behind ``keys``; ``largest`` is the largest count a sensor can have."""

    def __init__(self, keys: Sequence[str], largest: int) -> None:
        self._keys = [key.encode("ascii") for key in keys]
        self._largest = largest

    def __call__(self, line: bytes) -> Sample:
        """The sample of a line. Raises BadRecord: an unreadable place, a key twice, a reading too large.

        Keys that no sensor is behind are passed over, as the OpenGloves driver does, and their values have no
        bound: the firmware's trigger reaches twice half its range, one more than the largest count. Splay and
        joints may be left out beside their finger's flexion, as SenseShift's firmware does where they are 0;
        its first joint is never sent, it is the flexion.
        """
        found: dict[bytes, int] = {}
        at = 0
        while at < len(line):
            field = _FIELD.match(line, at)
            if field is None:
                raise BadRecord(f"no field begins at {shown(line[at:])}")
            key = field[1]
            if key in found:
                raise BadRecord(f"{key.decode()} comes twice")
            found[key] = self._value(key, field[2])
            at = field.end()
        return Sample(tuple(self._reading(key, found) for key in self._keys), button=_BUTTON in found)

    def _value(self, key: bytes, digits: bytes) -> int:
        name = key.decode()
        if key in _FLAGS and digits:
            raise BadRecord(f"{name} is a flag, and {digits.decode()} stands behind it")
        if not digits and key not in _NUMBERS and key not in self._keys:
            return 0
        return whole_number(digits, self._largest if key in self._keys else None, name)

    @staticmethod
    def _reading(key: bytes, found: dict[bytes, int]) -> int:
        if key in found:
            return found[key]
        if len(key) > 1 and key[1:2] in found:
            return found[key[1:2]] if key[2:] == _FIRST_JOINT else 0
        raise BadRecord(f"{key.decode()} is missing")
