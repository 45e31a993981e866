"""What the columns of a table mean, guessed from their names and values, each with its reason.

A name says most: a finger and a joint, a word for a reading or an angle, a unit. Where it says nothing,
values do: whole numbers come from a converter, and what lies beside such columns under a like name is alike.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
from pathlib import Path
from statistics import mode

import numpy as np

from glovecal_models.errors import BadTakeTable
from glovecal_models.names import CHANNEL
from glovecal_models.takes.answer import PER_UNIT, ColumnMapping, MappedColumn, Role, Unit
from glovecal_models.takes.column_mapping import (
    A_PAUSE_S,
    NOT_MEASURED,
    SEPARATORS,
    is_a_date,
    rows_of,
    seconds_of,
)
from glovecal_models.takes.raw_table import FASTEST_RATE_HZ, LARGEST_ANGLE_DEG, SLOWEST_RATE_HZ
from glovecal_models.takes.read_table import COMMENT

FIRST_ROWS = 2000
"""Whose values tell what a column is."""
HEADER_WITHIN = 60
MOST_DISTINCT = 60
"""More different values are no names of takes, wearings or poses."""
LONGEST_EXAMPLE = 24
WRITTEN = re.compile(r"[+-]?(\d+(\.\d*|,\d+)?|[.,]\d+)([eE][+-]?\d+)?")
"""A number, with a point or a decimal comma."""
FULL_TURN_RAD = 2.0 * np.pi
NUMERIC = 0.9
"""Share of a column's filled cells that are numbers, from which on it is one of numbers."""


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


TIME = _words(
    "time timestamp timestamps t ts sec secs second seconds s ms msec millis milliseconds us usec micros "
    "microseconds ns nanos nanoseconds clock elapsed datetime date zeit temps tiempo"
)
COUNTER = _words("frame frames sample samples seq sequence no nr number row n counter packet id idx index")
TAKE = _words("take takes trial task file recording run clip segment movement exercise motion")
WEARING = _words("wearing donning session placement wear")
POSE = _words("pose gesture sign posture phase label")
ANGLE = _words(
    "angle angles deg degree degrees rad radian radians ref reference truth gt mocap optitrack vicon opti "
    "opt qualisys motive gonio goniometer encoder target joint measured leap camera cam flexion extension "
    "abduction adduction winkel"
)
READING = _words(
    "raw sensor sensors sens adc ch chan channel volt volts voltage v mv flex bend strain stretch cap "
    "capacitance pf res resistance ohm kohm analog a glove reading readings counts count cnt value val fsr "
    "ain emg"
)
CONTEXT = _words("temp temperature humidity hum rh battery supply vcc vdd pressure light gsr celsius")
DEVIATION = _words("sd std sigma stddev deviation uncertainty")
FINGER = {
    "thumb": "T", "th": "T", "index": "I", "pointer": "I", "middle": "M", "mid": "M", "ring": "R",
    "pinky": "P", "pinkie": "P", "little": "P", "small": "P", "t": "T", "i": "I", "m": "M", "r": "R",
    "p": "P", "l": "P",
}  # fmt: skip
JOINT = {"mcp": "MCP", "mp": "MCP", "pip": "PIP", "dip": "DIP", "ip": "IP", "tmc": "TMC", "cmc": "TMC"}
UNIT_OF_TIME: dict[str, Unit] = {
    "s": "s", "sec": "s", "secs": "s", "second": "s", "seconds": "s", "ms": "ms", "msec": "ms",
    "millis": "ms", "milliseconds": "ms", "us": "us", "usec": "us", "micros": "us", "microseconds": "us",
    "ns": "ns", "nanos": "ns", "nanoseconds": "ns",
}  # fmt: skip


def guess_mapping(path: Path) -> ColumnMapping:
    """Raises BadTakeTable, with what is wrong, for a file that is no table of numbers. Where no column grows
    from row to row none is the time."""
    separator, line, headers, rows = _laid_out(path)
    decimal_comma = separator != "," and any(re.fullmatch(r"[+-]?\d+,\d+", cell) for cell in rows[-1])
    seen = [_Seen(header, [row[at] for row in rows], decimal_comma) for at, header in enumerate(headers)]
    roles = _roles(seen)
    angles = [item for item, (role, _) in zip(seen, roles, strict=True) if role in ("rotation", "deviation")]
    unit = _angle_unit(angles)
    columns = _named(
        [_column(item, role, why, unit) for item, (role, why) in zip(seen, roles, strict=True)],
    )
    at = next((index for index, item in enumerate(columns) if item.role == "time"), None)
    steps = np.diff(seen[at].seconds(columns[at].unit)) if at is not None else np.zeros(0)
    pauses = bool(((steps < 0) | (steps > A_PAUSE_S)).any())
    divides = pauses and not any(item.role == "take" for item in columns)
    return ColumnMapping(tuple(columns), separator, decimal_comma, line, divides)


# How the file is laid out.


def _laid_out(path: Path) -> tuple[str, int, list[str], list[list[str]]]:
    """What separates columns, the header's line (0: none), the names of the columns, and the first rows."""
    best: tuple[int, int, str, list[tuple[int, list[str]]]] | None = None
    for separator in SEPARATORS:
        with rows_of(path, separator) as stream:
            rows = list(islice(stream, FIRST_ROWS + HEADER_WITHIN))
        if not rows:
            raise BadTakeTable("the file is empty; send one with rows of numbers", file=path.name)
        last = rows[-max(1, len(rows) // 2) :]  # what stands above the table is of other widths
        width = mode(len(row) for _, row in last)
        alike = sum(len(row) == width and _is_of_numbers(row) for _, row in last)
        if width > 1 and (best is None or (alike, width) > best[:2]):
            best = alike, width, separator, rows
    if best is None or best[0] == 0:
        raise BadTakeTable(
            "no table of numbers: commas, semicolons, tabs, | or blanks separate no columns in its rows; "
            "send CSV, text or Parquet",
            file=path.name,
        )
    _, width, separator, rows = best
    above, headers = 0, [f"column_{at}" for at in range(1, width + 1)]
    for line, row in rows[:HEADER_WITHIN]:
        cells = [row[0].lstrip().lstrip("#%/ "), *row[1:]] if row[0].lstrip().startswith(COMMENT) else row
        if len(row) == width and _is_of_numbers(row):
            break
        if len(cells) == width and sum(bool(cell.strip()) for cell in cells) > width / 2 and not above:
            above, headers = line, [cell.strip() for cell in cells]
    below = [row for line, row in rows if line > above and len(row) == width and _is_of_numbers(row)]
    return separator, above, headers, below[:FIRST_ROWS]


def _is_of_numbers(row: Sequence[str]) -> bool:
    """Whether a row of the table may be meant, and not names or units."""
    return not row[0].lstrip().startswith(COMMENT) and any(WRITTEN.fullmatch(cell.strip()) for cell in row)


# What its columns are.


@dataclass(frozen=True)
class _Seen:
    """A column as it was seen in the first rows."""

    header: str
    cells: list[str]
    decimal_comma: bool

    @cached_property
    def words(self) -> list[str]:
        parts = re.sub(r"([a-z])([A-Z])", r"\1 \2", self.header)
        return re.findall(r"[a-z]+|\d+", parts.lower().replace("µ", "u").replace("°", " deg "))

    @cached_property
    def values(self) -> np.ndarray:
        """NaN where no number stands."""
        return np.array([self._number(cell) for cell in self.cells])

    def _number(self, cell: str) -> float:
        try:
            return float(cell.replace(",", ".") if self.decimal_comma else cell)
        except ValueError:
            return np.nan

    @cached_property
    def filled(self) -> list[str]:
        return [
            cell.strip() for cell in self.cells if cell.strip() and cell.strip().lower() not in NOT_MEASURED
        ]

    @cached_property
    def known(self) -> np.ndarray:
        return self.values[np.isfinite(self.values)]

    @property
    def is_empty(self) -> bool:
        return not self.filled

    @property
    def is_numeric(self) -> bool:
        return len(self.known) > NUMERIC * len(self.filled) > 0

    @property
    def is_date(self) -> bool:
        return bool(self.filled) and not self.is_numeric and all(map(is_a_date, self.filled[:20]))

    @property
    def is_whole(self) -> bool:
        return self.is_numeric and bool((self.known == np.round(self.known)).all())

    @property
    def largest(self) -> float:
        return float(np.abs(self.known).max(initial=0.0))

    @property
    def is_constant(self) -> bool:
        return len(set(self.filled)) <= 1

    @property
    def distinct(self) -> int:
        return len(set(self.filled))

    @property
    def mostly_grows(self) -> bool:
        """From row to row, as a time does, whatever takes follow one another."""
        steps = np.diff(self.known)
        return len(self.known) == len(self.cells) and len(steps) > 0 and bool(np.mean(steps > 0) > NUMERIC)

    @property
    def seldom_falls(self) -> bool:
        """As stamps that several rows share."""
        steps = np.diff(self.known)
        return len(steps) > 0 and bool(np.mean(steps < 0) < 1.0 - NUMERIC) and bool((steps > 0).any())

    @property
    def is_counted(self) -> bool:
        """0, 1, 2 ..."""
        steps = np.diff(self.known)
        return self.is_whole and len(steps) > 1 and float(np.median(steps)) == 1.0 and self.mostly_grows

    def seconds(self, unit: Unit) -> np.ndarray:
        if unit == "date":
            return np.array([seconds_of(cell) for cell in self.filled])
        return self.known * PER_UNIT[unit]

    def says(self, words: frozenset[str]) -> str:
        """The first of ``words`` that its name has; "" for none."""
        return next((word for word in self.words if word in words), "")


def _roles(seen: Sequence[_Seen]) -> list[tuple[Role, str]]:
    known = [_by_prefix(item) or _by_name(item) for item in seen]
    time = _time_of(seen, known)
    roles: list[tuple[Role, str] | None] = []
    for at, (item, role) in enumerate(zip(seen, known, strict=True)):
        if at == time:
            roles.append(("time", f"{item.header!r} grows from row to row"))
        elif role is not None and role[0] == "time":
            roles.append(("ignored", "another column is the time"))
        else:
            roles.append(role)
    return [
        role or _by_kin(at, seen, roles) or _by_values(item)
        for at, (item, role) in enumerate(zip(seen, roles, strict=True))
    ]


def _by_prefix(item: _Seen) -> tuple[Role, str] | None:
    """A take table's own columns."""
    own: dict[str, Role] = {"s": "sensor", "r": "rotation", "sd": "deviation", "c": "context"}
    prefix, dot, name = item.header.partition(".")
    if item.header == "time_s":
        return "time", "the name in a take table"
    if dot and name and prefix in own:
        return own[prefix], "the prefix of a take table"
    return None


def _by_name(item: _Seen) -> tuple[Role, str] | None:
    if item.is_empty:
        return "ignored", "it is empty"
    few = item.distinct <= MOST_DISTINCT and (not item.is_numeric or item.is_whole)
    named: tuple[tuple[frozenset[str], Role], ...] = ((TAKE, "take"), (WEARING, "wearing"), (POSE, "pose"))
    for words, role in named:
        if (word := item.says(words)) and few and not item.says(READING | (ANGLE - {"joint"})):
            return role, f"its name says {word!r}"
    if item.is_date:
        return "time", "its cells are dates or times of day"
    if not item.is_numeric:
        return "ignored", "text that no name explains"
    explained = item.says(READING | ANGLE | TIME)
    if item.is_counted and (not explained or (item.says(COUNTER) and not item.says(READING | ANGLE))):
        return "ignored", "it counts the rows"
    if item.seldom_falls and (word := item.says(TIME)) and not item.says(ANGLE | READING - {"a", "v"}):
        return "time", f"its name says {word!r}"
    if word := item.says(DEVIATION):
        return "deviation", f"its name says {word!r}"
    context, reading, angle = item.says(CONTEXT), item.says(READING), item.says(ANGLE)
    if context:
        return "context", f"its name says {context!r}"
    if reading and not angle:
        return "sensor", f"its name says {reading!r}"
    if angle and not reading and item.largest <= LARGEST_ANGLE_DEG:
        return "rotation", f"its name says {angle!r}"
    if reading and angle:  # such as raw angle sensor: a glove's own angles are readings
        return "sensor", f"its name says {reading!r}"
    return None


def _time_of(seen: Sequence[_Seen], known: Sequence[tuple[Role, str] | None]) -> int | None:
    named = [at for at, role in enumerate(known) if role is not None and role[0] == "time"]
    if named:  # the finest one: others are the day, or whole seconds
        return max(named, key=lambda at: len(set(seen[at].cells)))
    growing = [at for at, item in enumerate(seen) if item.is_numeric and item.mostly_grows]
    return growing[0] if growing else None


def _by_kin(
    at: int, seen: Sequence[_Seen], roles: Sequence[tuple[Role, str] | None]
) -> tuple[Role, str] | None:
    """A name like that of a column that is known: the same but for digits, or the same first word."""
    mine = seen[at]
    for like in (_without_digits, _first_word):
        for other, role in zip(seen, roles, strict=True):
            if role is None or role[0] not in ("sensor", "rotation") or other.is_whole != mine.is_whole:
                continue
            if like(other) == like(mine):
                return role[0], f"as {other.header!r}, whose name is like it"
    return None


def _without_digits(item: _Seen) -> list[str]:
    return [word for word in item.words if not word.isdigit()]


def _first_word(item: _Seen) -> list[str]:
    return item.words[:1]


def _by_values(item: _Seen) -> tuple[Role, str]:
    if item.is_constant:
        return "ignored", "it never changes, and its name says nothing"
    if item.is_whole:
        return "sensor", "whole numbers, as a converter gives"
    if item.largest <= LARGEST_ANGLE_DEG and _joint_of(item.words):
        return "rotation", "its name says a joint, and its numbers can be degrees"
    if item.known.min() < 0 and item.largest <= LARGEST_ANGLE_DEG and item.largest > 1.0:
        return "rotation", "numbers with decimals on both sides of 0, as angles have"
    return "sensor", "numbers with decimals; nothing says that they are angles"


# Units and names.


def _angle_unit(angles: Sequence[_Seen]) -> Unit:
    if not angles:
        return "deg"
    said = {word for item in angles for word in item.words}
    if said & {"rad", "radian", "radians"}:
        return "rad"
    if said & {"deg", "degree", "degrees"}:
        return "deg"
    whole = all(item.is_whole for item in angles)
    return "rad" if not whole and max(item.largest for item in angles) < FULL_TURN_RAD else "deg"


def _time_unit(item: _Seen) -> tuple[Unit, str]:
    if item.is_date:
        return "date", ""
    typical = _typical_step(item.known)
    named: list[Unit] = [UNIT_OF_TIME[word] for word in reversed(item.words) if word in UNIT_OF_TIME]
    units: list[Unit] = ["s", "ms", "us", "ns"]
    fitting: list[Unit] = [
        unit for unit in units if SLOWEST_RATE_HZ <= _rate(typical, unit) <= FASTEST_RATE_HZ
    ]
    likely: list[Unit] = [*(unit for unit in named if unit in fitting or not fitting), *fitting, "s"]
    unit = likely[0]
    return unit, f"{_rate(typical, unit):.4g} rows a second"


def _rate(step: float, unit: Unit) -> float:
    return 1.0 / (step * PER_UNIT[unit])


def _typical_step(times: np.ndarray) -> float:
    """Between rows; of stamps that several rows share the mean one."""
    steps = np.diff(times)
    middle = float(np.median(steps)) if len(steps) else 1.0
    grown = steps[steps >= 0]
    return middle if middle > 0 else float(grown.mean()) if grown.any() else 1.0


def _column(item: _Seen, role: Role, why: str, angle: Unit) -> MappedColumn:
    example = next(iter(item.filled), "")[:LONGEST_EXAMPLE]
    if role == "time" and item.header != "time_s":
        unit, rate = _time_unit(item)
        return MappedColumn(item.header, role, "", unit, "; ".join(filter(None, (why, rate))), example)
    unit = angle if role in ("rotation", "deviation") else "s" if role == "time" else ""
    return MappedColumn(item.header, role, "", unit, why, example)


def _named(columns: list[MappedColumn]) -> list[MappedColumn]:
    """With the names of sensors, rotations and context; the first of two times is the time."""
    named, used = [], set()
    for item in columns:
        if item.role in ("sensor", "rotation", "deviation", "context"):
            prefix, dot, rest = item.header.partition(".")
            own = rest if dot and prefix in ("s", "r", "sd", "c") else ""
            name = own or channel_name(item.header, item.role)
            number = 2
            while (item.role, name) in used:
                name, number = f"{name.rstrip('0123456789').rstrip('_')}_{number}", number + 1
            used.add((item.role, name))
            item = replace(item, name=name)
        named.append(item)
    return named


def _joint_of(words: Sequence[str]) -> str:
    """Such as ``I_PIP``; "" where no finger's joint is named."""
    finger = next((FINGER[word] for word in words if word in FINGER), "")
    joint = next((JOINT[word] for word in words if word in JOINT), "")
    return f"{finger}_{joint}" if finger and joint else ""


def channel_name(header: str, role: Role) -> str:
    """A channel's name of a foreign header: ``Index PIP angle [deg]`` is ``I_PIP``. What says the role and
    the unit goes, so that the sensor and the rotation of one joint have one name."""
    item = _Seen(header, [], False)
    if joint := _joint_of(item.words):
        return joint
    said = ANGLE | READING | DEVIATION
    core = [word for word in item.words if word not in said] if role != "context" else list(item.words)
    if not core or all(word.isdigit() for word in core):
        if CHANNEL.match(header):
            return header
        core = list(item.words) or ["column"]
    name = "_".join(core)
    if not name[0].isalpha():
        name = f"s_{name}"
    return name[:64]
