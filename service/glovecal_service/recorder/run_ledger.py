"""One recording's file and its books: which frames of which run are in it, and which are not."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from shutil import disk_usage
from typing import Any

import numpy as np

from glovecal_client.encryption.kept_file import open_kept
from glovecal_client.errors import WireError
from glovecal_client.frame_log import FrameLog, Recording
from glovecal_client.gap_repair import as_logged
from glovecal_client.wire.frame import Frame, decode_frame, frame_run_id, frame_sequence
from glovecal_service.recorder.run_books import RunBooks, SequenceRanges
from glovecal_service.store.recordings import with_pre_roll

SUFFIX = ".glog"
BEGIN = "begin"
"""Of the header: ``run_id``, ``sequence`` and ``wall_ns`` (its clock) where capture stood when the recording
began, and ``clock_ahead_ns``, by how much that clock was ahead of this computer's. Where it did not say so
the recording begins with the first frame that came."""
CAPTURE = "capture"
"""Of the header, and of a recording's facts where capture said it only later: its meta."""
CREATED = "created_wall_ns"
FINDINGS = "findings"
"""Of a recording's facts: what comparing it with its capture log brought, by run."""
TAKEN_OUT, REACHED = "taken_out", "reached"
"""Of a run's findings."""
LEFT_FREE_BYTES = 256 << 20
"""Of the disk, for frames that were asked for: hours of one glove."""


class RunLedger:
    """A frame log in ``recordings/``; every frame is written once, in the order it came.

    What turns out not to be the capture's stays in the file and leaves the books.
    """

    def __init__(self, log: FrameLog, known: Mapping[str, Mapping[str, Any]] | None = None) -> None:
        """``known``: what was found out before, as ``findings`` has it."""
        self._log = log
        self.taken_out = frames_taken_out(known or {})
        """By run: numbers whose frame, as it came over the wire, was not the capture's."""
        self.reached = {int(run, 16): int(of[REACHED]) for run, of in (known or {}).items() if REACHED in of}
        """By run: the last number that capture gave until its end, or until after the recording's; where it
        said so."""
        self.runs: dict[int, RunBooks] = {}
        """In the order they began."""
        self._open_first_run()
        self.capture: dict[str, Any] = dict(log.meta.get(CAPTURE) or {})
        """What capture said of itself and its glove; empty until it did."""
        self.created_wall_ns = int(log.meta.get(CREATED) or 0)
        """By this computer's clock."""
        self.last_wall_ns = 0
        """Of all frames that were asked for; by the capture computer's clock."""
        self.first_frame: Frame | None = None
        """The first frame that was asked for."""
        self.pre_roll = SequenceRanges()
        """Frames of the first run that come before it."""
        self.oldest_frame: Frame | None = None
        """The first frame of the pre-roll, or ``first_frame``."""

    @classmethod
    def create(cls, path: Path, meta: Mapping[str, Any]) -> RunLedger:
        """A new file. Raises FileExistsError, OSError."""
        return cls(FrameLog.create(path, meta))

    @classmethod
    def resume(cls, path: Path, known: Mapping[str, Mapping[str, Any]] | None = None) -> RunLedger:
        """A file that was left when its process was killed, cut back to its last whole record.

        ``known`` is as above. Raises DamagedLog, OSError.
        """
        file = cls(FrameLog.resume(path), known)
        file._enter_all()
        return file

    def _open_first_run(self) -> None:
        begin = self._log.meta.get(BEGIN)
        if begin is not None:
            run_id, wall_ns = int(begin["run_id"], 16), int(begin["wall_ns"])
            self.runs[run_id] = RunBooks(run_id, begin["sequence"] + 1, wall_ns, since_wall_ns=wall_ns)

    def _enter_all(self) -> None:
        for frame in usable_frames(Recording.open(self.path), self.taken_out):
            self._enter(frame)

    def take_out(self, run_id: int, sequences: Iterable[int]) -> None:
        """Note that the frames of these numbers that came over the wire are not the capture's, and make the
        books anew from all others."""
        known = self.taken_out.setdefault(run_id, SequenceRanges())
        for sequence in sequences:
            known.add(sequence)
        before, self.runs = self.runs, {}
        self._open_first_run()
        self.first_frame = self.oldest_frame = None
        self.pre_roll, self.last_wall_ns = SequenceRanges(), 0
        self._enter_all()
        for run_id, books in self.runs.items():
            if run_id in before:
                books.take_over(before[run_id])

    def note_reached(self, run_id: int, sequence: int) -> None:
        """Capture says so, at the run's end or after the recording's."""
        self.reached[run_id] = max(sequence, self.reached.get(run_id, -1))

    def findings(self) -> dict[str, dict[str, Any]]:
        """By run, 16 hexadecimal digits: what is to be known when the file is resumed, or read."""
        of_runs: dict[str, dict[str, Any]] = {}
        for run_id, out in self.taken_out.items():
            if not out:
                continue
            of_runs.setdefault(f"{run_id:016x}", {})[TAKEN_OUT] = [list(gap) for gap in out]
        for run_id, sequence in self.reached.items():
            of_runs.setdefault(f"{run_id:016x}", {})[REACHED] = sequence
        return of_runs

    def recorded(self) -> dict[int, RecordedFrames]:
        """The frames in the file by run, without those that were taken out."""
        of_runs: dict[int, tuple[array[int], array[int], array[int]]] = {}
        for place, message in Recording.open(self.path).places():
            run_id, sequence = frame_run_id(message), frame_sequence(message)
            out = self.taken_out.get(run_id)
            if out is None or sequence not in out or as_logged(message) is not message:
                columns = of_runs.setdefault(run_id, (array("Q"), array("Q"), array("Q")))
                for column, value in zip(columns, (sequence, place, len(message)), strict=True):
                    column.append(value)
        return {run_id: RecordedFrames(self.path, *columns) for run_id, columns in of_runs.items()}

    @property
    def path(self) -> Path:
        return self._log.path

    @property
    def meta(self) -> dict[str, Any]:
        return with_pre_roll(self._log.meta)

    @property
    def clock_ahead_ns(self) -> int | None:
        """By how much capture's clock was ahead when the recording began; None where it did not say so."""
        return self._log.meta.get(BEGIN, {}).get("clock_ahead_ns")

    @property
    def problem(self) -> str | None:
        """Why frames do not reach the disk, None if they do."""
        return self._log.problem

    def add(self, frame: Frame, message: bytes) -> bool:
        """Write a frame, or False if it is in already. While the disk is full frames wait in memory."""
        if not self._enter(frame):
            return False
        self._log.append(message)
        return True

    @property
    def lost_records(self) -> int:
        """Frames that the full disk did not take."""
        return self._log.lost_records

    @property
    def has_gaps(self) -> bool:
        """Whether the capture log can have more: frames are missing, or numbers that jumped are in doubt."""
        return any(books.missing() or books.doubtful() for books in self.runs.values())

    @property
    def has_ended(self) -> bool:
        """Whether capture said that the last run met is over."""
        return bool(self.runs) and next(reversed(self.runs.values())).ended

    @property
    def pre_roll_s(self) -> float:
        if self.first_frame is None or self.oldest_frame is None:
            return 0.0
        return (self.first_frame.monotonic_ns - self.oldest_frame.monotonic_ns) / 1e9

    @property
    def has_room_to_spare(self) -> bool:
        """Whether the disk takes more than the frames that were asked for."""
        return self.problem is None and disk_usage(self.path.parent).free > LEFT_FREE_BYTES

    @property
    def began_wall_ns(self) -> int | None:
        """By the capture computer's clock; None before that is known."""
        return next((books.began_wall_ns for books in self.runs.values()), None)

    def open_run(self, run_id: int, started_wall_ns: int) -> None:
        """Have the books of a run that began, by capture's clock, while the recording was going on.

        It belongs to the recording from its start, in its place among the runs.
        """
        if run_id not in self.runs:
            since_wall_ns = self.last_wall_ns or self.began_wall_ns or 0
            books = RunBooks(run_id, 0, started_wall_ns, since_wall_ns=since_wall_ns)
            first, *others = *self.runs.values(), books
            others.sort(key=lambda run: run.began_wall_ns)
            self.runs = {run.run_id: run for run in (first, *others)}

    def note_capture(self, meta: Mapping[str, Any]) -> None:
        """Keep what capture says of itself, if it is of a run recorded here and nothing is known yet."""
        if not self.capture and any(meta.get("run_id") == f"{run_id:016x}" for run_id in self.runs):
            self.capture = dict(meta)

    def lacks(self, frame: Frame) -> bool:
        """Whether the frame is one of those that are missing."""
        books = self.runs.get(frame.run_id)
        return books is not None and books.lacks(frame.sequence)

    def has(self, frame: Frame) -> bool:
        """Whether a frame of this number is recorded."""
        books = self.runs.get(frame.run_id)
        return books is not None and books.has(frame.sequence)

    def _enter(self, frame: Frame) -> bool:
        if not self.runs:
            self.runs[frame.run_id] = RunBooks(
                frame.run_id, frame.sequence, frame.wall_ns, since_wall_ns=frame.wall_ns
            )
        self.open_run(frame.run_id, frame.wall_ns)
        books, is_first = self.runs[frame.run_id], frame.run_id == next(iter(self.runs))
        if is_first and self._is_before_the_first(frame, books):
            return self._enter_pre_roll(frame)
        if not books.enter(frame):
            return False
        if is_first:
            self.first_frame = _earlier(frame, self.first_frame)
            self.oldest_frame = _earlier(frame, self.oldest_frame)
        self.last_wall_ns = max(self.last_wall_ns, frame.wall_ns)
        return True

    def _is_before_the_first(self, frame: Frame, books: RunBooks) -> bool:
        first = self.first_frame
        if not frame.repaired or first is None or books.lacks(frame.sequence):
            return False
        return frame.sequence < books.first and frame.monotonic_ns < first.monotonic_ns

    def _enter_pre_roll(self, frame: Frame) -> bool:
        if not self.pre_roll.add(frame.sequence):
            return False
        self.oldest_frame = _earlier(frame, self.oldest_frame)
        return True

    def sync(self) -> None:
        self._log.sync()

    def close(self) -> None:
        """Write what waits, sync, close. Frames the full disk did not take are missing from then on."""
        self._log.close()
        if self._log.lost_records:
            self._count_again()

    def _count_again(self) -> None:
        self.pre_roll, self.oldest_frame = SequenceRanges(), self.first_frame
        for run in self.runs.values():
            run.count_again()
        self._enter_all()


def frames_taken_out(findings: Mapping[str, Mapping[str, Any]]) -> dict[int, SequenceRanges]:
    """By run."""
    return {int(run, 16): SequenceRanges.of(finding.get(TAKEN_OUT, ())) for run, finding in findings.items()}


def usable_frames(recording: Recording, taken_out: Mapping[int, SequenceRanges]) -> Iterator[Frame]:
    """The frames in the order they were written, without those that were taken out; fetched ones stay."""
    for frame in recording.frames():
        if frame.repaired or frame.sequence not in taken_out.get(frame.run_id, ()):
            yield frame


class RecordedFrames:
    """Of one run, by sequence number; of several of one number the first in the file."""

    def __init__(self, path: Path, sequences: array[int], places: array[int], lengths: array[int]) -> None:
        self._path = path
        self.sequences, first = np.unique(np.array(sequences, np.uint64), return_index=True)
        """Increasing, shape (N,)."""
        self._places = np.array(places, np.uint64)[first]
        self._lengths = np.array(lengths, np.uint64)[first]

    def __len__(self) -> int:
        return len(self.sequences)

    def messages(self, rows: slice | Sequence[int]) -> list[bytes]:
        """As they lie in the capture log, if they are from there. Raises OSError."""
        messages = []
        with open_kept(self._path) as file:
            for place, length in zip(self._places[rows].tolist(), self._lengths[rows].tolist(), strict=True):
                file.seek(place)
                messages.append(as_logged(file.read(length)))
        return messages


def _earlier(frame: Frame, other: Frame | None) -> Frame:
    return frame if other is None or frame.monotonic_ns < other.monotonic_ns else other


def decoded(message: bytes) -> Frame | None:
    """The frame in ``message``; None for a damaged one, which then counts as not received."""
    try:
        return decode_frame(message)
    except WireError:
        return None
