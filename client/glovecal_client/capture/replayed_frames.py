"""Recordings to replay: a native frame log, or a take table with ``time_s`` and ``s.*`` columns."""

from __future__ import annotations

import csv
import itertools
import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from glovecal_client.errors import BadName, BadOption, DamagedLog, WireError, reason_of
from glovecal_client.log_records import MAGIC, Recording
from glovecal_client.names import check_channel_name

SIMULATED_COLUMN = "c.simulated"
"""Marks the takes of a table that were never measured."""
STRAY = "; remove this line if it holds units or a comment"
_NOT_SIMULATED = ("", "0", "0.0")


@dataclass(frozen=True, slots=True, eq=False)
class ReplayedFrame:
    """One recorded frame; ``time_s`` has any origin and starts anew where ``stretch`` changes."""

    time_s: float
    stretch: str
    """What the time belongs to: the run of a log, the take of a table."""
    readings: np.ndarray
    context: np.ndarray
    button: bool = False


class ReplayedFrames(Protocol):
    """A recording: what its frames hold, and the frames themselves from the start each time."""

    sensors: tuple[str, ...]
    context: tuple[str, ...]
    layout: str
    hand: str
    simulated: bool

    def frames(self) -> Iterator[ReplayedFrame]: ...


def open_recording(path: Path) -> ReplayedFrames:
    """The recording in ``path``. Raises BadOption naming the file and what is wrong with it."""
    try:
        with path.open("rb") as file:
            is_log = file.read(len(MAGIC)) == MAGIC
        return _FrameLogRecording(path) if is_log else _TableRecording(path)
    except (OSError, DamagedLog, BadName) as error:
        raise BadOption(f"replay of {path}: {reason_of(error)}") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise BadOption(f"replay of {path}: {_no_table(error)}") from error


def _no_table(error: UnicodeDecodeError | csv.Error) -> str:
    if isinstance(error, UnicodeDecodeError):
        return "it is not UTF-8 text; save it as UTF-8"
    return "a field there is too long, or holds a NUL byte; correct the table there"


class _FrameLogRecording:
    def __init__(self, path: Path) -> None:
        self._recording = Recording.open(path)
        meta = self._recording.meta
        self.sensors = _names(meta, "sensors", path)
        self.context = _names(meta, "context", path)
        self.layout = str(meta.get("layout", path.stem))
        self.hand = str(meta.get("hand", "unknown"))
        self.simulated = bool(meta.get("simulated", False))

    def frames(self) -> Iterator[ReplayedFrame]:
        try:
            for frame in self._recording.frames():
                yield ReplayedFrame(
                    frame.monotonic_ns / 1e9, str(frame.run_id), frame.readings, frame.context, frame.button
                )
        except WireError as error:
            raise BadOption(f"replay of {self._recording.path}: {error}") from error


def _names(meta: dict[str, Any], key: str, path: Path) -> tuple[str, ...]:
    names = meta.get(key, [])
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise BadOption(f"replay of {path}: {key} in its header must be a list of names, not {names!r}")
    return tuple(check_channel_name(name, key) for name in names)


def _identifier(text: str) -> str:
    """A table names no layout; its file's name, as far as it can be one, tells the user which it was."""
    return re.sub(r"[^a-z0-9_-]+", "-", text.lower()).strip("-_")[:64] or "table"


def _filled_rows(file: Iterable[str]) -> Iterator[tuple[int, list[str]]]:
    """The rows of a table that are not blank, each with its line; blanks after commas belong to no cell."""
    rows = csv.reader(file, skipinitialspace=True)
    for row in rows:
        if row:
            yield rows.line_num, row


class _TableRecording:
    """A take table; ``c.simulated`` other than 0 in its first row marks it, and is no context."""

    hand = "unknown"

    def __init__(self, path: Path) -> None:
        self._path = path
        self.layout = _identifier(path.stem)
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = _filled_rows(file)
            (line, header), (_, first) = next(rows, (1, [])), next(rows, (0, []))
        header = [name.strip() for name in header]
        if "time_s" not in header:
            raise BadOption(
                f"replay of {path}: line {line} has no column time_s; if the columns are named below, remove "
                "the lines above"
            )
        self._time = header.index("time_s")
        self._take = header.index("take") if "take" in header else None
        self._sensor_columns = [i for i, name in enumerate(header) if name.startswith("s.")]
        self._context_columns = [
            i for i, name in enumerate(header) if name.startswith("c.") and name != SIMULATED_COLUMN
        ]
        marks = dict(zip(header, first, strict=False))
        self.simulated = marks.get(SIMULATED_COLUMN, "").strip() not in _NOT_SIMULATED
        self.sensors = tuple(check_channel_name(header[i][2:], "sensor") for i in self._sensor_columns)
        self.context = tuple(check_channel_name(header[i][2:], "context") for i in self._context_columns)
        if not self.sensors:
            raise BadOption(f"replay of {path}: line {line} has no sensor columns; they are named s.SENSOR")
        self._header = header

    def frames(self) -> Iterator[ReplayedFrame]:
        with self._path.open(encoding="utf-8-sig", newline="") as file:
            line = 0
            try:
                for line, row in itertools.islice(_filled_rows(file), 1, None):
                    yield self._frame(row, line)
            except (csv.Error, UnicodeDecodeError) as error:
                raise BadOption(f"replay of {self._path}: after line {line}: {_no_table(error)}") from error

    def _frame(self, row: list[str], line: int) -> ReplayedFrame:
        if len(row) != len(self._header):
            raise BadOption(
                f"replay of {self._path}: line {line} has {len(row)} values, the header {len(self._header)}"
                f"{STRAY}"
            )
        time_s = self._number(row, self._time, line)
        if not math.isfinite(time_s):
            raise BadOption(f"replay of {self._path}: line {line}: time_s {row[self._time]!r} is not a time")
        return ReplayedFrame(
            time_s,
            row[self._take] if self._take is not None else "",
            self._numbers(row, self._sensor_columns, line),
            self._numbers(row, self._context_columns, line),
        )

    def _numbers(self, row: list[str], columns: list[int], line: int) -> np.ndarray:
        return np.array([self._number(row, column, line) for column in columns], np.float32)

    def _number(self, row: list[str], column: int, line: int) -> float:
        text = row[column].strip()
        try:
            return float(text) if text else math.nan
        except ValueError:
            raise BadOption(
                f"replay of {self._path}: line {line}, column {self._header[column]!r}: {text!r} is no number"
                f"{STRAY}"
            ) from None


def nominal_rate_hz(recording: ReplayedFrames, frames: int = 1000) -> float:
    """Frames a second by the median step of the first ones. Raises BadOption if there are fewer than two."""
    first = list(itertools.islice(recording.frames(), frames))
    steps = [b.time_s - a.time_s for a, b in itertools.pairwise(first) if a.stretch == b.stretch]
    rising = [step for step in steps if step > 0]
    if not rising:
        raise BadOption("replay: the recording has no two frames at different times")
    return 1.0 / float(np.median(rising))
