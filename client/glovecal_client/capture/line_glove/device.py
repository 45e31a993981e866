"""The capture device ``line``: any glove that sends lines of numbers, described by a TOML file.

``line:my-glove.toml`` with the option ``port``; ``docs/own-glove.md`` explains the file.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from glovecal_client.capture.device_clock import DeviceClock
from glovecal_client.capture.line_glove.checksum import CHECKSUMS
from glovecal_client.capture.line_glove.description import LineDescription, read_description
from glovecal_client.capture.stream.lines import LineReader
from glovecal_client.capture.stream.links import Link
from glovecal_client.capture.stream.option_values import COMMON_HELP, OptionValues
from glovecal_client.capture.stream.parser import Sample, StreamParser
from glovecal_client.capture.stream.streamed_glove import StreamedGlove
from glovecal_client.errors import BadOption

_NUMBER = re.compile(rb"[+-]?[0-9]{1,9}(\.[0-9]{1,9})?")
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
        self._parse = DescribedLine(description)
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
        return LineReader(self._parse, self.counters)

    def new_clock(self) -> DeviceClock | None:
        told = self._description
        return None if told.time_column is None else DeviceClock(told.ticks_per_second, told.wraps_at)

    def answer(self, link: Link, data: bytes) -> None:
        if self._description.answer and (lines := data.count(b"\n")):
            link.write(self._description.answer.encode() * lines)


class DescribedLine:
    """Parses one line; None for one whose form, checksum or range is not as described."""

    def __init__(self, description: LineDescription) -> None:
        self._told = description
        self._start = description.start.encode()
        self._separator = description.separator.encode()

    def __call__(self, line: bytes) -> Sample | None:
        body = self._body(line)
        if body is None:
            return None
        told = self._told
        fields = body.split() if told.separator.isspace() else body.split(self._separator)
        if len(fields) != told.columns:
            return None
        values = tuple(_number(fields[column]) for column in told.sensor_columns)
        if not all(self._in_range(value) for value in values):
            return None
        ticks = None
        if told.time_column is not None:
            ticks = _number(fields[told.time_column])
            if not ticks >= 0:  # NaN too
                return None
        context = tuple(factor * _number(fields[column]) for _, column, factor in told.context)
        return Sample(values, None if ticks is None else int(ticks), context)

    def _body(self, line: bytes) -> bytes | None:
        """The line without its start and checksum, None if either is wrong."""
        told = self._told
        if not line.startswith(self._start):
            return None
        if told.checksum is None:
            return line[len(self._start) :]
        covered, found, check = line.rpartition(told.check_separator.encode())
        if not found or not _DIGITS[told.check_base].fullmatch(check.strip()):
            return None
        body = covered[len(self._start) :]
        summed = covered if told.covers_start else body
        return body if CHECKSUMS[told.checksum](summed) == int(check, told.check_base) else None

    def _in_range(self, value: float) -> bool:
        lowest, highest = self._told.lowest, self._told.highest
        return (
            math.isfinite(value)
            and (lowest is None or value >= lowest)
            and (highest is None or value <= highest)
        )


def _number(field: bytes) -> float:
    """The number in a field, NaN for anything else."""
    text = field.strip()
    return float(text) if _NUMBER.fullmatch(text) else math.nan
