"""The capture device ``line``: any glove that sends lines of numbers, described by a TOML file.

``line:my-glove.toml`` with the option ``port``; ``docs/own-glove.md`` explains the file.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar

from glovecal_client.capture.device_clock import DeviceClock
from glovecal_client.capture.line_glove.checksum import CHECKSUMS
from glovecal_client.capture.line_glove.description import LineDescription, read_description
from glovecal_client.capture.stream.lines import LineReader
from glovecal_client.capture.stream.links import Link
from glovecal_client.capture.stream.option_values import COMMON_HELP, OptionValues
from glovecal_client.capture.stream.parser import BadRecord, Sample, StreamParser, shown
from glovecal_client.capture.stream.streamed_glove import StreamedGlove
from glovecal_client.errors import BadOption

_NUMBER = re.compile(rb"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,4})?")
"""Whatever a program prints of a number: no bound on its digits."""
_DIGITS = {10: re.compile(rb"[0-9]{1,10}"), 16: re.compile(rb"[0-9A-Fa-f]{1,8}")}


class LineGlove(StreamedGlove):
    """A glove as its description says."""

    name = "line"
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
