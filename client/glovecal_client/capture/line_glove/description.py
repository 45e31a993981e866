"""The TOML file that describes a glove sending lines of numbers, checked when it is read."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from glovecal_client.capture.line_glove.checksum import CHECKSUMS
from glovecal_client.errors import BadName, BadOption
from glovecal_client.names import check_channel_name, check_identifier, did_you_mean

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
