"""Device ``replay:FILE``: plays a recording back at its own pace, with the times of now.

A recording is a native frame log, or a take table with ``time_s`` and ``s.*`` columns.
"""

from __future__ import annotations

import csv
import itertools
import math
import re
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np

from glovecal_client.capture.device import Reading, check_options
from glovecal_client.clock import clock_ns, clock_s, wall_ns
from glovecal_client.encryption.kept_file import open_kept
from glovecal_client.errors import BadName, BadOption, DamagedLog, DeviceFinished, WireError, reason_of
from glovecal_client.frame_log import MAGIC, Recording
from glovecal_client.keys import check_channel_name, check_identifier

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
        with open_kept(path) as file:
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


class ReplayDevice:
    """Gives the frames of a recording ``speed`` times as fast as they were taken, once or for ever.

    A reading that is missing in the recording comes as NaN, for the daemon to refuse and count.
    """

    usage = "replay:FILE"
    about = "A recording, played back at its own pace."
    option_help: ClassVar[dict[str, str]] = {
        "speed": "TIMES (1 is as recorded)",
        "loop": "yes|no (no)",
        "layout": "NAME (as in the recording)",
    }

    def __init__(
        self, path: Path | str, *, speed: float = 1.0, loop: bool = False, layout: str | None = None
    ) -> None:
        """Raises BadOption if the file cannot be replayed; all of it is read once for that."""
        if not 0 < speed < float("inf"):
            raise BadOption(f"replay: speed {speed:g} must be a positive number")
        path = Path(path)
        self._recording = open_recording(path)
        self._speed = speed
        self._loop = loop
        self._frames: Iterator[ReplayedFrame] | None = None
        self.name: str = f"replay:{path.name}"
        self.layout: str = layout or self._recording.layout
        self.sensors: tuple[str, ...] = self._recording.sensors
        self.context: tuple[str, ...] = self._recording.context
        self.hand: str = self._recording.hand
        self.simulated: bool = self._recording.simulated
        self.rate_hz: float = nominal_rate_hz(self._recording) * speed
        self._count = sum(1 for _ in self._recording.frames())

    @classmethod
    def from_options(cls, argument: str | None, options: Mapping[str, str]) -> ReplayDevice:
        """``replay:FILE`` with options ``speed=2``, ``loop=yes``, ``layout=NAME``. Raises BadOption."""
        if not argument:
            raise BadOption("device replay needs a file: replay:FILE")
        check_options("replay", options, cls.option_help)
        loop = options.get("loop", "no")
        if loop not in ("yes", "no"):
            raise BadOption(f"replay: loop={loop!r} must be yes or no")
        try:
            speed = float(options.get("speed", "1"))
        except ValueError:
            raise BadOption(f"replay: speed={options['speed']!r} is not a number") from None
        layout = options.get("layout")
        if layout is not None:
            check_identifier(layout, "layout")
        return cls(Path(argument), speed=speed, loop=loop == "yes", layout=layout)

    def open(self) -> None:
        """Start from the beginning."""
        self._frames = self._recording.frames()
        self._due_s = clock_s()
        self._before: ReplayedFrame | None = None
        self._next: ReplayedFrame | None = None
        self._given = 0

    def close(self) -> None:
        """Stop; ``open`` starts from the beginning again."""
        self._frames = None

    def read(self, timeout_s: float) -> Reading | None:
        """The next recorded frame when its time has come. Raises DeviceFinished at the end."""
        if self._next is None:
            self._next = self._advance()
            self._due_s += self._step_s(self._before, self._next)
        waiting = self._due_s - clock_s()
        if waiting > timeout_s:
            time.sleep(timeout_s)
            return None
        if waiting > 0:
            time.sleep(waiting)
        frame, self._next = self._next, None
        self._before = frame
        self._given += 1
        return Reading(frame.readings, clock_ns(), wall_ns(), context=frame.context, button=frame.button)

    def _advance(self) -> ReplayedFrame:
        if self._frames is None:
            raise DeviceFinished(f"{self.name}: not open")
        frame = next(self._frames, None)
        if frame is None and self._loop:
            self._frames = self._recording.frames()
            frame = next(self._frames, None)
        if frame is None:
            raise DeviceFinished(f"{self.name}: all {self._given} frames were replayed")
        return frame

    def _step_s(self, before: ReplayedFrame | None, after: ReplayedFrame) -> float:
        """Seconds from one frame to the next; one nominal period where the recording starts anew."""
        if before is None:
            return 0.0
        step = after.time_s - before.time_s
        if after.stretch != before.stretch or step < 0:
            return 1.0 / self.rate_hz
        return step / self._speed
