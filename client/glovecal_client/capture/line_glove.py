"""The capture device ``line``: any glove that sends lines of numbers, described by a TOML file.

``line:my-glove.toml`` with the option ``port``; ``docs/own-glove.md`` explains the file, which is checked
when it is read. Lines may carry a checksum: ``xor`` is NMEA 0183's, ``sum`` adds bytes modulo 256, ``crc16``
is CRC-16/CCITT-FALSE (polynomial 0x1021, start 0xFFFF), ``crc32`` is zlib's.
"""

from __future__ import annotations

import binascii
import math
import re
import sys
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import xor
from pathlib import Path
from typing import Any, ClassVar, NoReturn

from glovecal_client.capture.device_clock import DeviceClock
from glovecal_client.capture.stream.links import Link
from glovecal_client.capture.stream.parser import BadRecord, LineReader, Sample, StreamParser, shown
from glovecal_client.capture.stream.streamed_glove import COMMON_HELP, OptionValues, StreamedGlove
from glovecal_client.errors import BadName, BadOption
from glovecal_client.keys import check_channel_name, check_identifier, did_you_mean


def _xor(data: bytes) -> int:
    return reduce(xor, data, 0)


def _sum(data: bytes) -> int:
    return sum(data) & 0xFF


def _crc16(data: bytes) -> int:
    return binascii.crc_hqx(data, 0xFFFF)


CHECKSUMS: dict[str, Callable[[bytes], int]] = {
    "xor": _xor,
    "sum": _sum,
    "crc16": _crc16,
    "crc32": zlib.crc32,
}


UNUSED = "-"
MOST_LINES = 64
TICKS_PER_SECOND = {"s": 1, "ms": 1_000, "us": 1_000_000}
_KEYS = {
    "": ("name", "layout", "rate_hz", "baud", "line", "values", "checksum", "time", "context"),
    "line": ("separator", "start", "columns", "pattern", "lines", "end", "answer"),
    "values": ("lowest", "highest", "unit"),
    "checksum": ("kind", "separator", "digits", "covers_start"),
    "time": ("column", "unit", "wraps_at"),
}


@dataclass(frozen=True)
class LineDescription:
    """A line: ``start``, values between ``separator``, then ``check_separator`` and a checksum, if any."""

    layout: str
    sensors: tuple[str, ...]
    sensor_columns: tuple[int, ...]
    columns: tuple[str, ...]
    pattern: re.Pattern[bytes] | None = None
    """Finds the columns by its named groups, instead of a separator."""
    lines: int = 1
    """How many lines make a sample, for a pattern."""
    end: bytes = b"\n"
    separator: str = ","
    start: str = ""
    answer: str = ""
    rate_hz: float = 60.0
    baud: int = 115200
    lowest: float | None = None
    highest: float | None = None
    unit: str = ""
    """What the readings are in; told when the glove is opened."""
    checksum: str | None = None
    check_separator: str = "*"
    check_base: int = 16
    covers_start: bool = False
    time_column: int | None = None
    ticks_per_second: int = 1_000
    wraps_at: float = 1 << 32
    context: tuple[tuple[str, int, float], ...] = ()
    """Name, column and factor of each context value."""

    @property
    def used_columns(self) -> tuple[int, ...]:
        """Columns whose fields must be numbers: sensors and time. Context may be missing in a line."""
        return self.sensor_columns if self.time_column is None else (*self.sensor_columns, self.time_column)


def read_description(file: Path) -> LineDescription:
    """Raises BadOption, with the file, the key, the value and what would be right."""
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        import tomli as tomllib

    try:
        document = tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadOption(f"line: {file} cannot be read: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        found = re.search(r"line \d+, column \d+", str(error))
        place = f" from {found[0]} on" if found else ", or not UTF-8 text"
        raise BadOption(f"line: {file} is not TOML{place}; docs/own-glove.md shows one") from error
    return _Reader(file.name, document).description(file.stem.lower())


def _quoted(choice: str) -> str:
    """As it is, or as TOML writes it where it cannot be seen."""
    return choice if choice.isprintable() else repr(choice)


class _Reader:
    def __init__(self, file: str, document: Mapping[str, Any]) -> None:
        self._file = file
        self._tables = {"": document}
        for name, keys in _KEYS.items():
            table = document.get(name, {}) if name else document
            if not isinstance(table, Mapping):
                self._refuse(f"{name} must be a table, [{name}]")
            self._tables[name] = table
            for key in table:
                if key not in keys:
                    self._refuse(f"unknown key {self._named(name, key)}; {did_you_mean(key, keys)}")

    def description(self, default_name: str) -> LineDescription:
        pattern = self._pattern()
        columns = self._columns() if pattern is None else tuple(pattern.groupindex)
        lines = self._positive("line", "lines", 1.0)
        if lines != int(lines) or (lines > 1 and pattern is None) or lines > MOST_LINES:
            self._refuse(
                f"line.lines = {lines:g} must be a whole number up to {MOST_LINES}, and needs line.pattern"
            )
        time_column = self._get("time", "column", str, "")
        context = tuple(self._context(columns))
        used = {UNUSED, time_column, *(columns[column] for _, column, _ in context)}
        sensors = tuple(name for name in columns if name not in used)
        if not sensors:
            self._refuse("line.columns names no sensor: every column is unused, time or context")
        kind = self._get("checksum", "kind", str, "") if "checksum" in self._tables[""] else None
        if kind is not None and kind not in CHECKSUMS:
            self._refuse(f"checksum.kind = {kind!r} must be one of {', '.join(CHECKSUMS)}")
        try:
            for name in (*sensors, *(name for name, _, _ in context)):
                check_channel_name(name, f"line: {self._file}: column")
            layout = self._get("", "layout", str, self._get("", "name", str, default_name))
            check_identifier(layout, f"line: {self._file}: layout")
        except BadName as error:
            raise BadOption(str(error)) from error
        return LineDescription(
            layout=layout,
            sensors=sensors,
            sensor_columns=tuple(columns.index(name) for name in sensors),
            columns=columns,
            pattern=pattern,
            lines=int(lines),
            end=self._one_of("line", "end", ("\n", "\r")).encode(),
            separator=self._get("line", "separator", str, ","),
            start=self._get("line", "start", str, ""),
            answer=self._get("line", "answer", str, ""),
            rate_hz=self._positive("", "rate_hz", 60.0),
            baud=int(self._positive("", "baud", 115200)),
            lowest=self._get("values", "lowest", float, None),
            highest=self._get("values", "highest", float, None),
            unit=self._get("values", "unit", str, ""),
            checksum=kind,
            check_separator=self._get("checksum", "separator", str, "*"),
            check_base={"hex": 16, "decimal": 10}[self._one_of("checksum", "digits", ("hex", "decimal"))],
            covers_start=self._get("checksum", "covers_start", bool, False),
            time_column=self._place(columns, time_column, "time.column") if time_column else None,
            ticks_per_second=TICKS_PER_SECOND[self._one_of("time", "unit", ("ms", "us", "s"))],
            wraps_at=self._positive("time", "wraps_at", float(1 << 32)),
            context=context,
        )

    def _pattern(self) -> re.Pattern[bytes] | None:
        text = self._get("line", "pattern", str, "")
        if not text:
            return None
        for key in ("columns", "separator"):
            if key in self._tables["line"]:
                self._refuse(f"line.pattern finds the columns itself: leave line.{key} out")
        try:
            pattern = re.compile(text.encode())
        except re.error as error:
            self._refuse(f"line.pattern is no regular expression: {error.msg} at character {error.pos}")
        if not pattern.groupindex:
            self._refuse("line.pattern names no column: write (?P<I_FLEX>[0-9]+) where a reading stands")
        return pattern

    def _columns(self) -> tuple[str, ...]:
        columns = self._tables["line"].get("columns")
        if not isinstance(columns, list) or not columns or not all(isinstance(name, str) for name in columns):
            self._refuse('line.columns must list the columns by name, as in ["ms", "I_MCP", "-"]')
        named = [name for name in columns if name != UNUSED]
        for name in named:
            if named.count(name) > 1:
                self._refuse(f"line.columns names {name!r} more than once; an unused column is {UNUSED!r}")
        return tuple(columns)

    def _context(self, columns: tuple[str, ...]) -> list[tuple[str, int, float]]:
        table = self._tables[""].get("context", {})
        found = []
        for name, entry in table.items() if isinstance(table, Mapping) else ():
            if not isinstance(entry, Mapping) or set(entry) - {"column", "factor"} or "column" not in entry:
                self._refuse(f'context.{name} must be {{ column = "NAME", factor = NUMBER }}, not {entry!r}')
            factor = entry.get("factor", 1.0)
            if isinstance(factor, bool) or not isinstance(factor, int | float):
                self._refuse(f"context.{name}.factor = {factor!r} must be a number")
            column = self._place(columns, str(entry["column"]), f"context.{name}.column")
            found.append((name, column, float(factor)))
        return found

    def _place(self, columns: tuple[str, ...], name: str, key: str) -> int:
        if name not in columns:
            self._refuse(f"{key} = {name!r} is none of the columns {', '.join(columns)}")
        return columns.index(name)

    def _get(self, table: str, key: str, kind: type, otherwise: Any) -> Any:
        value = self._tables[table].get(key, otherwise)
        if kind is float and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        if value is not otherwise and not isinstance(value, kind):
            what = {str: "a text", float: "a number", bool: "true or false"}[kind]
            self._refuse(f"{self._named(table, key)} = {value!r} must be {what}")
        return value

    def _positive(self, table: str, key: str, otherwise: float) -> float:
        value = self._get(table, key, float, float(otherwise))
        if not 0 < value < float("inf"):
            self._refuse(f"{self._named(table, key)} = {value!r} must be a positive number")
        return value

    def _one_of(self, table: str, key: str, choices: tuple[str, ...]) -> str:
        value = self._get(table, key, str, choices[0])
        if value not in choices:
            self._refuse(
                f"{self._named(table, key)} = {value!r} must be one of {', '.join(map(_quoted, choices))}"
            )
        return value

    @staticmethod
    def _named(table: str, key: str) -> str:
        return f"{table}.{key}" if table else key

    def _refuse(self, sentence: str) -> NoReturn:
        raise BadOption(f"line: {self._file}: {sentence}")


_NUMBER = re.compile(rb"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,4})?")
"""Whatever a program prints of a number: no bound on its digits."""
_DIGITS = {10: re.compile(rb"[0-9]{1,10}"), 16: re.compile(rb"[0-9A-Fa-f]{1,8}")}


class LineGlove(StreamedGlove):
    """A glove as its description says."""

    name = "line"
    usage = "line:FILE --option port=PORT"
    about = "Any glove that sends lines of numbers, by USB, TCP or UDP: FILE describes them."
    option_help: ClassVar[dict[str, str]] = {
        "port": "PORT|tcp:PORT|udp:PORT, where the glove is (required)",
        **COMMON_HELP,
    }

    def __init__(self, description: LineDescription, address: str, options: OptionValues) -> None:
        """Raises BadOption."""
        self.baud: int = description.baud
        super().__init__(address, options)
        self._description = description
        self.layout: str = description.layout
        self.sensors: tuple[str, ...] = description.sensors
        self.context: tuple[str, ...] = tuple(name for name, _, _ in description.context)
        self.rate_hz: float = description.rate_hz
        if description.lowest is not None and description.highest is not None:
            self.counts: tuple[float, float] | None = (description.lowest, description.highest)
        self.notice: str = f"readings in {description.unit}" if description.unit else ""

    @classmethod
    def from_options(cls, argument: str | None, options: Mapping[str, str]) -> LineGlove:
        """``line:FILE`` with option ``port``. Raises BadOption."""
        if not argument:
            raise BadOption("device line needs a description: line:my-glove.toml")
        values = OptionValues(cls.name, options, cls.option_help)
        if not (port := values.text("port", "")):
            raise BadOption("device line needs to know where the glove is: --option port=/dev/ttyUSB0")
        return cls(read_description(Path(argument)), port, values)

    def new_parser(self) -> StreamParser:
        return LineReader(DescribedLine(self._description), self.counters, end=self._description.end)

    def new_clock(self) -> DeviceClock | None:
        told = self._description
        return None if told.time_column is None else DeviceClock(told.ticks_per_second, told.wraps_at)

    def answer(self, link: Link, data: bytes) -> None:
        if self._description.answer and (lines := data.count(self._description.end)):
            link.write(self._description.answer.encode() * lines)


def _measured(field: bytes) -> float:
    """A context value, NaN where the glove says that there is none."""
    text = field.strip()
    value = float(text) if _NUMBER.fullmatch(text) else math.nan
    return value if math.isfinite(value) else math.nan


class DescribedLine:
    """Parses one line, or the last of several that make a sample."""

    def __init__(self, description: LineDescription) -> None:
        self._told = description
        self._start = description.start.encode()
        self._separator = description.separator.encode()
        self._lines: list[bytes] = []
        """Those before, of a sample that is not complete."""

    def __call__(self, line: bytes) -> Sample | None:
        """None while more lines follow. Raises BadRecord: form, checksum or range is not as described."""
        told = self._told
        fields = self._fields(self._body(line))
        if fields is None:
            return None
        numbers = {column: self._number(column, fields[column]) for column in told.used_columns}
        values = tuple(numbers[column] for column in told.sensor_columns)
        for name, value in zip(told.sensors, values, strict=True):
            self._check_range(name, value)
        ticks = None if told.time_column is None else numbers[told.time_column]
        if ticks is not None and not (math.isfinite(ticks) and ticks >= 0):
            raise BadRecord(f"the time {ticks:g} is negative or not finite")
        context = tuple(factor * _measured(fields[column]) for _, column, factor in told.context)
        return Sample(values, ticks, context)

    def _fields(self, body: bytes) -> Sequence[bytes] | None:
        """The columns' texts, None where lines are still to come."""
        told = self._told
        if told.pattern is None:
            fields = body.split() if told.separator.isspace() else body.split(self._separator)
            if len(fields) != len(told.columns):
                raise BadRecord(f"{len(fields)} fields, not {len(told.columns)}")
            return fields
        self._lines = [*self._lines, body][-told.lines :]
        found = told.pattern.fullmatch(b"\n".join(self._lines))
        if found is None:
            if len(self._lines) < told.lines:
                return None
            raise BadRecord("it does not match line.pattern")
        self._lines = []
        return [found[name] or b"" for name in told.columns]

    def _body(self, line: bytes) -> bytes:
        """The line without its start and checksum. Raises BadRecord if either is wrong."""
        told = self._told
        if not line.startswith(self._start):
            raise BadRecord(f"it does not begin with {told.start!r}")
        if told.checksum is None:
            return line[len(self._start) :]
        covered, found, check = line.rpartition(told.check_separator.encode())
        if not found or not _DIGITS[told.check_base].fullmatch(check.strip()):
            raise BadRecord(f"no checksum behind {told.check_separator!r}")
        body = covered[len(self._start) :]
        summed = covered if told.covers_start else body
        if CHECKSUMS[told.checksum](summed) != int(check, told.check_base):
            raise BadRecord("its checksum is wrong")
        return body

    def _number(self, column: int, field: bytes) -> float:
        text = field.strip()
        if not _NUMBER.fullmatch(text):
            raise BadRecord(f"{self._told.columns[column]} is {shown(text)}, not a number")
        return float(text)

    def _check_range(self, name: str, value: float) -> None:
        lowest, highest = self._told.lowest, self._told.highest
        if not math.isfinite(value):
            raise BadRecord(f"{name} is not finite")
        if lowest is not None and value < lowest:
            raise BadRecord(f"{name} is {value:g}, below {lowest:g}")
        if highest is not None and value > highest:
            raise BadRecord(f"{name} is {value:g}, above {highest:g}")
