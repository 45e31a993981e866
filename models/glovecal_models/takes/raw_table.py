"""A take table as it stands in a file: checked columns, not yet divided into takes.

Columns: which names are allowed, what they hold, and what was probably meant.

Frame times as recorders write them: in other units than seconds, or stamped in batches.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from glovecal_models.errors import BadInput, BadTakeTable
from glovecal_models.names import check_channel_name

ColumnKind = Literal["time", "take", "wearing", "pose", "sensor", "rotation", "deviation", "context"]
MOST_COLUMNS = 1000
_PLAIN: dict[str, ColumnKind] = {"time_s": "time", "take": "take", "wearing": "wearing", "pose": "pose"}
_PREFIXED: dict[str, ColumnKind] = {
    "s": "sensor", "r": "rotation", "sd": "deviation", "c": "context",
}  # fmt: skip
_ALLOWED = "time_s, take, wearing, pose, s.<SENSOR>, r.<ROTATION>, sd.<ROTATION> and c.<CONTEXT>"
_TIME_LIKE = {"time", "t", "timestamp", "seconds", "second", "time_sec", "times", "time_ms", "ms", "time(s)"}
SLOWEST_STEP_S = 1.5
"""Single poses set by hand come about once a second; a glove of 5 Hz or more in ms is above."""
FASTEST_RATE_HZ = 10_000.0
SLOWEST_RATE_HZ = 5.0
COARSEST_STAMP_S = 1.5
"""Whole seconds are still spread; a stamp for longer tells nothing of a hand."""
FEWEST_STAMPS = 3
LONGEST_PERIODS = 2.0
"""A batch whose frames would lie further apart than that many of the usual period is followed by a pause."""
_UNITS = (("milliseconds", 1e3), ("microseconds", 1e6), ("nanoseconds", 1e9))


@dataclass(frozen=True)
class Column:
    """One column: its header, what kind of values it holds, and the channel's name."""

    header: str
    kind: ColumnKind
    name: str

    @property
    def is_text(self) -> bool:
        return self.kind in ("take", "wearing", "pose")

    @property
    def may_be_empty(self) -> bool:
        """Angles, their deviations and context may be missing in a row; times and readings may not."""
        return self.kind in ("rotation", "deviation", "context")


def parse_header(headers: Sequence[str], file: str) -> list[Column]:
    """The columns of a table, in order. Raises BadTakeTable for an unknown, repeated or missing one."""
    if len(headers) > MOST_COLUMNS:
        raise BadTakeTable(f"{len(headers)} columns; at most {MOST_COLUMNS} are read", file=file, line=1)
    columns = [_parse_column(header.strip(), place, file) for place, header in enumerate(headers, start=1)]
    seen: set[str] = set()
    for column in columns:
        if column.header in seen:
            raise BadTakeTable(
                "this column stands twice; remove or rename one", file=file, line=1, column=column.header
            )
        seen.add(column.header)
    for column in columns:
        if column.kind == "deviation" and f"r.{column.name}" not in seen:
            raise BadTakeTable(
                f"there is no r.{column.name} beside it, whose standard deviation it would be",
                file=file,
                line=1,
                column=column.header,
            )
    if "time_s" not in seen:
        raise BadTakeTable(f"there is no column time_s; columns are {_ALLOWED}", file=file, line=1)
    return columns


def _parse_column(header: str, place: int, file: str) -> Column:
    if not header:
        raise BadTakeTable(f"column {place} has no name; columns are {_ALLOWED}", file=file, line=1)
    if header in _PLAIN:
        return Column(header, _PLAIN[header], header)
    prefix, dot, name = header.partition(".")
    if not dot or prefix not in _PREFIXED:
        raise BadTakeTable(
            f"unknown column; {_what_was_meant(header)}", file=file, line=1, column=header[:80]
        )
    try:
        check_channel_name(name, "rotation" if prefix == "sd" else _PREFIXED[prefix])
    except BadInput as error:
        raise BadTakeTable(str(error), file=file, line=1, column=header[:80]) from error
    return Column(header, _PREFIXED[prefix], name)


def _what_was_meant(header: str) -> str:
    prefix, dot, name = header.partition(".")
    near_prefix = next((known for known in _PREFIXED if prefix[:1].lower() == known), None)
    if dot and name and near_prefix:
        return f"did you mean {near_prefix}.{name[:80]}?"
    if header.lower() in _TIME_LIKE:
        return "did you mean time_s (in seconds)?"
    near = difflib.get_close_matches(header.lower(), _PLAIN, n=1)
    if near:
        return f"did you mean {near[0]}?"
    if not dot and header.isidentifier():
        return f"write s.{header[:80]} for raw readings or r.{header[:80]} for reference angles"
    return f"columns are {_ALLOWED}"


MOST_CELLS = 50_000_000
"""Larger tables are refused: about three hours of an 18-sensor glove with its reference at 120 Hz."""
LONGEST_TEXT = 200
LARGEST_ANGLE_DEG = 360.0
"""A joint turns less than once, however its zero is chosen; unwrapped angles of a tracker stay below too."""
LARGEST_VALUE = float(np.finfo(np.float32).max)
"""Live frames carry readings and context as float32."""
LATEST_TIME_S = 1e11
"""Seconds since 1970 reach this in the year 5138, seconds since the year 1 are below."""
YEAR_S = 365.25 * 86400.0
LONGEST_TAKE_S = YEAR_S
"""A take lies inside one wearing."""


@dataclass(frozen=True)
class RawTable:
    """Columns of equal length; numbers are float64 with NaN where a cell was empty."""

    file: str
    columns: tuple[Column, ...]
    numbers: dict[str, np.ndarray]
    texts: dict[str, list[str]]
    lines: np.ndarray | None
    """Line of each row in the file (1 is the header), None where a file has no lines."""

    @property
    def time_s(self) -> np.ndarray:
        return self.numbers["time_s"]

    def __len__(self) -> int:
        return len(self.time_s)

    def names(self, kind: ColumnKind) -> tuple[str, ...]:
        return tuple(column.name for column in self.columns if column.kind == kind)

    def matrix(self, kind: ColumnKind, rows: np.ndarray) -> np.ndarray:
        """The columns of one kind at ``rows``, shape (len(rows), number of columns)."""
        headers = [column.header for column in self.columns if column.kind == kind]
        if not headers:
            return np.empty((len(rows), 0))
        return np.column_stack([self.numbers[header][rows] for header in headers])

    def error(
        self, problem: str, *, row: int | None = None, column: str | None = None, value: str | None = None
    ) -> BadTakeTable:
        """An error that names this file, the row's line, the column and the value."""
        if row is not None and self.lines is None:
            problem = f"row {row + 1}: {problem}"
        line = int(self.lines[row]) if row is not None and self.lines is not None else None
        return BadTakeTable(problem, file=self.file, line=line, column=column, value=value)


def unusable_number(column: Column, values: np.ndarray) -> int | None:
    """Index of the first number the column must not hold, None if all are fine."""
    bad = ~(np.abs(values) <= _largest(column))
    if column.kind == "deviation":
        bad |= values <= 0
    if column.may_be_empty:
        bad &= ~np.isnan(values)
    return int(np.argmax(bad)) if bad.any() else None


def what_is_wrong(column: Column, value: float, shown: str) -> str:
    """Why ``value`` cannot stand in this numerical column, and what would be right: a sentence."""
    if not math.isfinite(value):
        return f"{shown} is not finite; {what_is_right(column)}"
    right = what_is_right(column)
    if column.kind == "rotation":
        limit = f"{LARGEST_ANGLE_DEG:g} either way"
        return f"{shown} is impossible for an angle in degrees (limit {limit}); {right}"
    if column.kind == "deviation":
        limit = f"above 0, at most {LARGEST_ANGLE_DEG:g}"
        return f"{shown} is impossible for a standard deviation ({limit}); {right}"
    if column.kind == "time":
        limit = f"{LATEST_TIME_S:g}: {LATEST_TIME_S / YEAR_S:.0f} years"
        divide = "divide milliseconds by 1e3, microseconds by 1e6, nanoseconds by 1e9"
        return f"{shown} is impossible for a time in seconds (limit {limit}); {right} ({divide})"
    return f"{shown} is larger than a live frame can carry (float32, limit {LARGEST_VALUE:.3g}); {right}"


def what_is_right(column: Column) -> str:
    """What a cell of this numerical column should hold, as the end of a sentence."""
    if column.kind == "time":
        return "write the time in seconds"
    if column.kind == "sensor":
        return "every frame needs a finite reading, as the glove sends it"
    if column.kind == "rotation":
        return "write the angle in degrees, or leave it empty where nothing was measured"
    if column.kind == "deviation":
        return "write the angle's standard deviation in degrees, or leave it empty where nothing was measured"
    return "write a number, or leave it empty where nothing was measured"


def _largest(column: Column) -> float:
    if column.kind == "time":
        return LATEST_TIME_S
    return LARGEST_ANGLE_DEG if column.kind in ("rotation", "deviation") else LARGEST_VALUE


def unusable_text(column: Column, texts: Sequence[str]) -> tuple[int, str] | None:
    """Index and problem of the first text the column must not hold, None if all are fine."""
    for text in dict.fromkeys(texts):
        problem = ""
        if len(text) > LONGEST_TEXT:
            problem = f"a text of {len(text)} characters; at most {LONGEST_TEXT} are kept"
        elif not text.isprintable():
            problem = f"{text!r} holds characters that cannot be printed"
        elif column.kind == "take" and not text.strip():
            problem = "is empty; every row needs the name of its take"
        if problem:
            return list(texts).index(text), problem
    return None


def time_unit_warning(typical_step: float) -> str | None:
    """A sentence's end on a median step between frames (as if in seconds) that no glove has, else None."""
    if typical_step > SLOWEST_STEP_S:
        return f"one frame every {typical_step:.4g} s. time_s is wanted in seconds{unit_hint(typical_step)}."
    if typical_step < 1.0 / FASTEST_RATE_HZ:
        return (
            f"{1.0 / typical_step:.4g} frames a second. time_s is wanted in seconds; is it in minutes, hours"
            " or days?"
        )
    return None


def unit_hint(typical_step: float) -> str:
    """Which unit would make ``typical_step`` a glove's, as the end of a sentence; "" when none would."""
    for unit, per_second in _UNITS:
        rate_hz = per_second / typical_step
        if SLOWEST_RATE_HZ <= rate_hz <= FASTEST_RATE_HZ:
            return f"; if it is in {unit} ({rate_hz:.4g} Hz), divide by {per_second:.0e}".replace("e+0", "e")
    return ""


def too_few_digits(time: np.ndarray) -> bool:
    """Whether stamps are too coarse to tell when a frame was taken: at least two frames each on average, and
    fewer than ``FEWEST_STAMPS`` of them or more than ``COARSEST_STAMP_S`` apart."""
    stamps = np.unique(time)
    if 2 * len(stamps) > len(time):  # a row that was written twice
        return False
    return len(stamps) < FEWEST_STAMPS or float(np.median(np.diff(stamps))) > COARSEST_STAMP_S


def spread_equal_times(time: np.ndarray) -> np.ndarray:
    """Times in which each run of equal values is spread over its batch; times that run backwards stay.

    Stamps cut down to a decimal place (whole seconds, say) stand for what follows up to the next: a batch
    begins at its stamp, and the first one, which may have begun before the recording, ends at the next. Other
    stamps are those of a buffer that was handed over, before or after its frames were taken: their frames lie
    around the stamp, so that none moves by more than half a batch. A pause belongs to no batch.
    """
    starts = np.flatnonzero(np.concatenate([[True], np.diff(time) != 0]))
    lengths = np.diff(np.append(starts, len(time)))
    steps = np.diff(time[starts])
    if len(starts) in (1, len(time)) or not (steps > 0).all():
        return time
    whole = slice(1 if len(steps) > 1 else 0, None)  # the first batch may have begun before the recording
    period = float(np.median((steps / lengths[:-1])[whole]))
    own = np.append(steps / lengths[:-1], min(period, float(np.median(steps)) / lengths[-1]))
    own = np.where(own > LONGEST_PERIODS * period, period, own)
    place = np.arange(len(time)) - np.repeat(starts, lengths)
    if not _is_cut_down(time[starts]):
        place = place - np.repeat((lengths - 1) / 2, lengths)
        return np.repeat(time[starts], lengths) + place * np.repeat(
            _apart(time[starts], lengths, own), lengths
        )
    spread = time + (place + 0.5) * np.repeat(own, lengths)
    first = np.arange(lengths[0])
    spread[: lengths[0]] = np.maximum(
        time[starts[1]] - (lengths[0] - first - 0.5) * period, time[0] + (first + 0.5) * own[0]
    )
    return spread


def _is_cut_down(stamps: np.ndarray) -> bool:
    """Whether stamps are whole numbers of their usual step: 1, 0.1, 0.01 ... seconds."""
    step = float(np.median(np.diff(stamps)))
    decimal = 10.0 ** round(np.log10(step))
    whole = stamps / decimal
    return abs(step / decimal - 1) < 0.01 and bool((np.abs(whole - np.round(whole)) < 1e-3).all())


def _apart(stamps: np.ndarray, lengths: np.ndarray, own: np.ndarray) -> np.ndarray:
    """How far the frames of each batch are apart: no batch reaches into its neighbours."""
    free = np.diff(stamps)
    room = 2 * free / (lengths[:-1] + lengths[1:])
    return np.minimum(own, np.minimum(np.append(room, np.inf), np.insert(room, 0, np.inf)) * (1 - 1e-9))
