"""One recording's file and its books: which frames of which run are in it, and which are not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from shutil import disk_usage
from typing import Any

from glovecal_client.errors import WireError
from glovecal_client.frame_log import FrameLog
from glovecal_client.log_records import Recording
from glovecal_client.plausible_loss import BURST_FRAMES, PlausibleLoss
from glovecal_client.wire.frame import Frame, decode_frame
from glovecal_service.realtime.sequence_ranges import SequenceRanges
from glovecal_service.store.recordings import with_pre_roll

SUFFIX = ".glog"
BEGIN = "begin"
"""Of the header: ``run_id``, ``sequence`` and ``wall_ns`` (its clock) where capture stood when the recording
began. Where it did not say so the recording begins with the first frame that came."""
OWN_CLOCK = "own_clock"
CREATED = "created_wall_ns"
LEFT_FREE_BYTES = 256 << 20
"""Of the disk, for frames that were asked for: hours of one glove."""


@dataclass
class RunBooks:
    """The frames of one start of the capture daemon."""

    run_id: int
    first: int
    """Where the recording begins in this run; 0 for a run that began while it was going on, if it can be."""
    recorded: SequenceRanges = field(default_factory=SequenceRanges)
    repaired: int = 0
    """Of the recorded frames, those fetched from the capture log."""
    last: int = -1
    """The last frame that belongs to the recording, as far as is known; ``first - 1``: none."""
    last_wall_ns: int = 0
    """Of the last frame recorded."""
    ended: bool = False
    """Capture said that the run is over, and that ``last`` was its last frame."""
    own_clock: dict[str, Any] | None = None
    """How the glove's own clock stood against the computer's, as capture said last."""
    earlier: list[RunBooks] = field(default_factory=list)
    """What came before each jump of the publisher's numbers; the numbers jumped over were never sent."""

    def __post_init__(self) -> None:
        self.last = max(self.last, self.first - 1)

    def missing(self) -> list[tuple[int, int]]:
        before = [gap for books in self.earlier for gap in books.missing()]
        return [*before, *self.recorded.missing(self.first, self.last)]

    @property
    def sent(self) -> int:
        return sum(books.sent for books in self.earlier) + max(0, self.last - self.first + 1)

    @property
    def recorded_frames(self) -> int:
        return sum(len(books.recorded) for books in (*self.earlier, self))

    def lacks(self, sequence: int) -> bool:
        """Whether the frame is missing."""
        return any(
            books.first <= sequence <= books.last and sequence not in books.recorded
            for books in (*self.earlier, self)
        )

    def jump_to(self, sequence: int) -> None:
        """From ``sequence`` on the numbers are counted anew."""
        self.earlier.append(RunBooks(self.run_id, self.first, self.recorded, last=self.last))
        self.first, self.last, self.recorded = sequence, sequence - 1, SequenceRanges()

    def enter(self, frame: Frame) -> bool:
        """Note a frame as recorded; False if it was."""
        for books in self.earlier:
            if books.lacks(frame.sequence):
                return books.recorded.add(frame.sequence)
        if not self.recorded.add(frame.sequence):
            return False
        if frame.sequence >= self.last:
            self.last, self.last_wall_ns = frame.sequence, frame.wall_ns
        return True

    def document(self) -> dict[str, Any]:
        """``sent`` equals ``recorded`` plus the frames in ``missing``, which may still come."""
        return {
            "run_id": f"{self.run_id:016x}",
            "first_sequence": (*self.earlier, self)[0].first,
            "last_sequence": self.last,
            "sent": self.sent,
            "recorded": self.recorded_frames,
            "repaired": self.repaired,
            "missing": [list(gap) for gap in self.missing()],
        } | ({} if self.own_clock is None else {OWN_CLOCK: self.own_clock})


class RunLedger:
    """A frame log in ``recordings/``; every frame is written once, in the order it came."""

    def __init__(self, log: FrameLog) -> None:
        self._log = log
        self.runs: dict[int, RunBooks] = {}
        """In the order they were first met."""
        begin = log.meta.get(BEGIN)
        if begin is not None:
            run_id = int(begin["run_id"], 16)
            self.runs[run_id] = RunBooks(run_id, begin["sequence"] + 1)
        self._begin_wall_ns = 0 if begin is None else int(begin["wall_ns"])
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
    def resume(cls, path: Path) -> RunLedger:
        """A file that was left when its process was killed, cut back to its last whole record.

        Raises DamagedLog, OSError.
        """
        file = cls(FrameLog.resume(path))
        for frame in Recording.open(path).frames():
            file._enter(frame, jumped=not frame.repaired and file.has_jumped(frame))
        return file

    def has_jumped(self, frame: Frame) -> bool:
        """Whether the numbers jumped to ``frame``, as far as the frames in the file and their times tell."""
        books = self.runs.get(frame.run_id)
        if books is None:
            lost = frame.sequence if self.runs else 0
        elif books.lacks(frame.sequence):
            return False
        else:
            lost = frame.sequence - books.last - 1
            if lost < 0 and not books.recorded_frames:  # on its way when capture said where it stood
                return -lost > BURST_FRAMES
        return lost < 0 or not PlausibleLoss(self.last_wall_ns or self._begin_wall_ns).allows(
            lost, frame.wall_ns
        )

    @property
    def path(self) -> Path:
        return self._log.path

    @property
    def meta(self) -> dict[str, Any]:
        return with_pre_roll(self._log.meta)

    @property
    def problem(self) -> str | None:
        """Why frames do not reach the disk, None if they do."""
        return self._log.problem

    def add(self, frame: Frame, message: bytes, *, jumped: bool = False) -> bool:
        """Write a frame, or False if it is in already. While the disk is full frames wait in memory.

        ``jumped``: its publisher gave it another number than the next; the numbers between were never sent.
        """
        if not self._enter(frame, jumped=jumped):
            return False
        self._log.append(message)
        return True

    @property
    def lost_records(self) -> int:
        """Frames that the full disk did not take."""
        return self._log.lost_records

    @property
    def has_gaps(self) -> bool:
        return any(books.missing() for books in self.runs.values())

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

    def open_run(self, run_id: int) -> RunBooks:
        """The books of a run; one that was not met before belongs to the recording from its start."""
        return self.runs.setdefault(run_id, RunBooks(run_id, 0))

    def lacks(self, frame: Frame) -> bool:
        """Whether the frame is one of those that are missing."""
        books = self.runs.get(frame.run_id)
        return books is not None and books.lacks(frame.sequence)

    def has(self, frame: Frame) -> bool:
        """Whether a frame of this number is recorded."""
        books = self.runs.get(frame.run_id)
        return books is not None and any(frame.sequence in part.recorded for part in (*books.earlier, books))

    def _enter(self, frame: Frame, *, jumped: bool = False) -> bool:
        books = self.runs.get(frame.run_id)
        if books is None:
            first = 0 if self.runs and not jumped else frame.sequence
            books = self.runs[frame.run_id] = RunBooks(frame.run_id, first)
        elif jumped:
            books.jump_to(frame.sequence)
        if frame.sequence < books.first and not books.lacks(frame.sequence):
            return frame.repaired and self._enter_pre_roll(frame)
        if not books.enter(frame):
            return False
        if books is next(iter(self.runs.values())):
            self.first_frame = _earlier(frame, self.first_frame)
            self.oldest_frame = _earlier(frame, self.oldest_frame)
        books.repaired += frame.repaired
        self.last_wall_ns = max(self.last_wall_ns, frame.wall_ns)
        return True

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
            run.repaired = run.last_wall_ns = 0
            for books in (*run.earlier, run):
                books.recorded = SequenceRanges()
        for frame in Recording.open(self.path).frames():
            self._enter(frame)


def _earlier(frame: Frame, other: Frame | None) -> Frame:
    return frame if other is None or frame.monotonic_ns < other.monotonic_ns else other


def decoded(message: bytes) -> Frame | None:
    """The frame in ``message``; None for a damaged one, which then counts as not received."""
    try:
        return decode_frame(message)
    except WireError:
        return None
