"""What a format of another program is: text to lines of sensors, and back."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import Handedness

MOST_CHARACTERS = 1 << 20
"""Of a file; the longest of these formats has a few thousand."""
MARKED_WITHIN = 4000
"""Characters in which a format's mark stands."""


@dataclass(frozen=True)
class SensorLine:
    """angle = gain x (reading - zero)."""

    gain: float
    """Degrees a count; not 0."""
    zero: float
    """The reading at which the rotation is 0 degrees, counts."""

    @classmethod
    def through(cls, first: tuple[float, float], second: tuple[float, float]) -> SensorLine | None:
        """Through two points (reading, degrees); None where they tell no line, or no finite one."""
        (x, a), (y, b) = first, second
        if x == y or a == b:
            return None
        gain = (b - a) / (y - x)
        zero = x - a / gain if gain else math.inf
        return cls(gain, zero) if math.isfinite(gain) and math.isfinite(zero) else None

    def reading(self, degrees: float) -> float:
        """At which the rotation has this angle."""
        return self.zero + degrees / self.gain


@dataclass(frozen=True)
class Counts:
    """What the sensors of a layout can send."""

    lowest: float
    highest: float

    @property
    def per_8_bit(self) -> float:
        """Counts of this glove for one of an 8-bit glove: 16 where they have 12 bits."""
        return 2.0 ** max(round(math.log2((self.highest + 1) / 256)), 0)


@dataclass(frozen=True)
class FoundLines:
    """What a file says."""

    lines: Mapping[str, SensorLine]
    """By sensor, which has the name of its rotation; a finger's sensor may be read for several."""
    left_out: Mapping[str, str] = field(default_factory=dict)
    """Why a sensor in the file has no line."""
    doubts: Mapping[str, str] = field(default_factory=dict)
    """What the file says of a sensor and its line does not."""


Read = Callable[[str, Counts, Handedness], FoundLines]
Write = Callable[[Mapping[str, SensorLine], Counts, Handedness], str]


@dataclass(frozen=True)
class CalibrationFormat:
    name: str
    title: str
    read: Read
    """Raises BadInput, with the line, for text that is none of this format."""
    write: Write
    """Raises BadInput."""
    mark: re.Pattern[str]
    """What such a file has at its beginning and no other format has, also where the rest is damaged."""

    def recognises(self, text: str) -> bool:
        return self.mark.search(text[:MARKED_WITHIN]) is not None


def require_lines(found: FoundLines, what: str) -> FoundLines:
    """Raises BadInput where nothing was found."""
    if found.lines:
        return found
    why = "; ".join(f"{name}: {reason}" for name, reason in found.left_out.items())
    raise BadInput(f"{what} has no sensor with a line" + (f" ({why})" if why else ""))


def numbers(words: Sequence[str], place: str) -> list[float]:
    """Raises BadInput for a word that is no finite number."""
    found = []
    for word in words:
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise BadInput(f"{place}: {word[:40]!r} is no number")
        found.append(value)
    return found
