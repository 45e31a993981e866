"""SMPTE time code: labels of frames, drop-frame counting, and which label a take has at which time."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Literal

from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean

FrameRate = Literal["23.976", "24", "25", "29.97", "30", "50", "59.94", "60"]
RATES: dict[str, Fraction] = {
    "23.976": Fraction(24000, 1001),
    "24": Fraction(24),
    "25": Fraction(25),
    "29.97": Fraction(30000, 1001),
    "30": Fraction(30),
    "50": Fraction(50),
    "59.94": Fraction(60000, 1001),
    "60": Fraction(60),
}
"""Frames a second, by the names that recorders show."""
WITH_DROP = ("29.97", "59.94")
_LABEL = re.compile(r"(\d{1,2}):(\d{2}):(\d{2})([:;.,])(\d{2})\Z")
_ROUNDING = 1e-4
"""Of a frame: a time this close before a frame is its own, computed with rounding errors."""


@dataclass(frozen=True)
class Counting:
    """How frames are counted: ``rate`` is a name in ``RATES``; with ``drop`` numbers are left out so that
    labels keep to the clock, though 29.97 frames pass in a second of 30 numbers."""

    rate: str
    drop: bool = False

    def __post_init__(self) -> None:
        """Raises BadInput."""
        if self.rate not in RATES:
            raise BadInput(f"no frame rate {self.rate[:20]!r}; {did_you_mean(self.rate[:20], RATES)}")
        if self.drop and self.rate not in WITH_DROP:
            raise BadInput(f"drop-frame counting is of {' and '.join(WITH_DROP)}, not of {self.rate}")

    @property
    def frames_per_s(self) -> Fraction:
        return RATES[self.rate]

    @property
    def numbers_per_s(self) -> int:
        """Numbers of a labelled second that leaves none out: 30 for 29.97."""
        return round(self.frames_per_s)

    @property
    def left_out(self) -> int:
        """Numbers left out at the beginning of each minute that is no multiple of ten."""
        return self.numbers_per_s // 15 if self.drop else 0

    @property
    def frames_per_day(self) -> int:
        return 144 * self._frames_per_ten_minutes

    @property
    def _frames_per_ten_minutes(self) -> int:
        return 600 * self.numbers_per_s - 9 * self.left_out

    def frame(self, hours: int, minutes: int, seconds: int, number: int) -> int:
        """Frames since 00:00:00:00. Raises BadInput for a label that is not counted."""
        begins = minutes % 10 != 0 and seconds == 0
        fits = hours < 24 and minutes < 60 and seconds < 60 and number < self.numbers_per_s
        if not fits or (begins and number < self.left_out):
            label = f"{hours:02d}:{minutes:02d}:{seconds:02d}{self.separator}{number:02d}"
            raise BadInput(f"there is no time code {label} at {self.named} frames a second")
        whole = 60 * hours + minutes
        every = (60 * whole + seconds) * self.numbers_per_s + number
        return every - self.left_out * (whole - whole // 10)

    def label(self, frame: int) -> str:
        """Inverse of ``frame``; after a day labels begin again."""
        tens, rest = divmod(frame % self.frames_per_day, self._frames_per_ten_minutes)
        minute = 60 * self.numbers_per_s
        if rest >= minute:  # the first minute of ten is whole
            later = 1 + (rest - minute) // (minute - self.left_out)
            rest += self.left_out * later
        seconds, number = divmod(tens * 600 * self.numbers_per_s + rest, self.numbers_per_s)
        minutes, seconds = divmod(seconds, 60)
        hours, minutes = divmod(minutes, 60)
        return f"{hours:02d}:{minutes:02d}:{seconds:02d}{self.separator}{number:02d}"

    @property
    def separator(self) -> str:
        return ";" if self.drop else ":"

    @property
    def named(self) -> str:
        return f"{self.rate} drop-frame" if self.drop else self.rate


@dataclass(frozen=True)
class TimeCode:
    """Frame ``label`` began at ``time_s``, seconds of the take's clock (as its ``time_s``)."""

    label: str
    rate: str
    drop: bool
    time_s: float
    source: str
    """Where it comes from, in words."""

    @classmethod
    def of_text(cls, text: str, rate: str | None, time_s: float, source: str) -> TimeCode:
        """From ``HH:MM:SS:FF``; ``;`` before the frames says drop-frame, at 29.97 where ``rate`` is None.

        Raises BadInput, also where the rate is not known.
        """
        parts = _LABEL.match(text.strip())
        if parts is None:
            raise BadInput(f"{text[:40]!r} is no time code; write it like 01:00:00:00, or 01:00:00;00")
        drop = parts[4] == ";"
        if rate is None and not drop:
            raise BadInput(f"time code {text.strip()} does not tell its frame rate: give one of {_listed()}")
        counting = Counting(rate or "29.97", drop)
        hours, minutes, seconds, number = (int(parts[at]) for at in (1, 2, 3, 5))
        label = counting.label(counting.frame(hours, minutes, seconds, number))
        return cls(label, counting.rate, drop, time_s, source)

    @classmethod
    def of_document(cls, document: Mapping[str, Any]) -> TimeCode:
        """Inverse of ``document``."""
        return cls(**{name: document[name] for name in ("label", "rate", "drop", "time_s", "source")})

    def document(self) -> dict[str, Any]:
        return dict(vars(self))

    @property
    def counting(self) -> Counting:
        return Counting(self.rate, self.drop)

    def at(self, time_s: float) -> str:
        """The label of the frame in which ``time_s`` lies, seconds of the take's clock."""
        counting = self.counting
        later = math.floor((time_s - self.time_s) * float(counting.frames_per_s) + _ROUNDING)
        return counting.label(self._frame + later)

    @property
    def _frame(self) -> int:
        hours, minutes, seconds, number = map(int, re.split("[:;]", self.label))
        return self.counting.frame(hours, minutes, seconds, number)


def _listed() -> str:
    return ", ".join(RATES)
