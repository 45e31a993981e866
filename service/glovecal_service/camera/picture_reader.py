"""The thread that reads pictures: stamps checked, kept, handed on; a camera that was lost is opened again.

Kept are all pictures as they came (FFV1), the labels of those tracked, or nothing: a file for each stretch
without an interruption. A disk that is full, or another problem, is said and counted, and the poses go on.
Handed on is the newest: one that waits still is replaced.
"""

from __future__ import annotations

import statistics
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from glovecal_client.capture.status import CaptureStatus
from glovecal_client.clock import clock_ns, computer_id, wall_ns
from glovecal_client.errors import ClientError, DeviceFinished, reason_of
from glovecal_client.pictures.label_file import LabelWriter
from glovecal_client.pictures.recording import NOT_ENDED, describe_video
from glovecal_client.pictures.source import Picture, PictureSource
from glovecal_client.pictures.video_file import VideoWriter
from glovecal_client.private_files import PRIVATE_FOLDER
from glovecal_service.camera.camera_settings import Keep

TRY_AGAIN_AFTER_S = 5.0


class KeptPictures:
    """``keep_picture`` is for the thread that reads, ``keep_labels`` for the one that tracks."""

    def __init__(self, keep: Keep, folder: Path, glove: str) -> None:
        self.keep = keep
        self.pictures = 0
        """Kept so far."""
        self.failed = 0
        """That should have been kept and were not."""
        self.problem = ""
        self.file: Path | None = None
        """The newest."""
        self._folder, self._glove = folder, glove
        self._video: tuple[VideoWriter, PictureSource] | None = None
        self._labels: LabelWriter | None = None
        self._lock = threading.Lock()
        self._not_before_s = 0.0

    def keep_picture(self, source: PictureSource, picture: Picture) -> None:
        """As it came, where that is wanted."""
        if self.keep == "pictures":
            with self._lock:
                self._try(lambda: self._write_picture(source, picture))

    def keep_labels(self, labels: np.ndarray, source: PictureSource, monotonic_ns: int, wall_ns: int) -> None:
        """With the picture's own stamps."""
        if self.keep == "labels":
            with self._lock:
                self._try(lambda: self._write_labels(labels, source, monotonic_ns, wall_ns))

    def begin_anew(self) -> None:
        """The camera was lost: what comes next goes into another file."""
        with self._lock:
            self._close()

    def close(self) -> None:
        self.begin_anew()

    def _try(self, write: Callable[[], None]) -> None:
        if time.monotonic() < self._not_before_s:
            self.failed += 1
            return
        try:
            write()
        except (ClientError, OSError) as error:
            self.problem, self.failed = reason_of(error), self.failed + 1
            self._not_before_s = time.monotonic() + TRY_AGAIN_AFTER_S
            self._close()
        else:
            self.problem, self.pictures = "", self.pictures + 1

    def _write_picture(self, source: PictureSource, picture: Picture) -> None:
        if self._video is None:
            self.file = self._new_file(".mkv")
            self._video = VideoWriter(self.file, source.rate_hz), source
            describe_video(self.file, source, 0, NOT_ENDED)
        self._video[0].write(picture)

    def _write_labels(
        self, labels: np.ndarray, source: PictureSource, monotonic_ns: int, wall_ns: int
    ) -> None:
        if self._labels is None:
            facts = {"source": source.name, "simulated": source.simulated, "computer": computer_id()}
            self.file = self._new_file(".labels")
            self._labels = LabelWriter(self.file, (labels.shape[0], labels.shape[1]), facts)
        self._labels.write(labels, monotonic_ns, wall_ns)

    def _new_file(self, suffix: str) -> Path:
        self._folder.mkdir(mode=PRIVATE_FOLDER, parents=True, exist_ok=True)
        at = f"{time.strftime('%Y%m%d-%H%M%S')}-{clock_ns() // 1_000_000 % 1000:03d}"
        return self._folder / f"{self._glove}-{at}{suffix}"

    def _close(self) -> None:
        video, labels = self._video, self._labels
        self._video = self._labels = None
        with suppress(OSError):  # a full disk was said before
            if labels is not None:
                labels.close()
            if video is not None:
                writer, source = video
                writer.close()
                describe_video(writer.path, source, writer.pictures, self.problem)


@dataclass(frozen=True, eq=False)
class NumberedPicture:
    """A picture of this run, and the times that its pose gets."""

    number: int
    picture: Picture
    monotonic_ns: int
    """By this computer's clock: as the picture says, or when a recorded one was due."""
    wall_ns: int


class NewestPicture:
    """Holds one picture; another that comes before it was taken replaces it, and that is counted."""

    def __init__(self) -> None:
        self.skipped = 0
        """Pictures that were replaced."""
        self._held: NumberedPicture | None = None
        self._is_over = False
        self._changed = threading.Condition()

    def put(self, picture: NumberedPicture) -> None:
        with self._changed:
            self.skipped += self._held is not None
            self._held = picture
            self._changed.notify_all()

    def take(self, timeout_s: float) -> NumberedPicture | None:
        """The picture held, None when none came in time."""
        with self._changed:
            self._changed.wait_for(lambda: self._held is not None or self._is_over, timeout_s)
            taken, self._held = self._held, None
            return taken

    def end(self) -> None:
        """No more will come."""
        with self._changed:
            self._is_over = True
            self._changed.notify_all()

    @property
    def is_over(self) -> bool:
        """Whether nothing is held and no more will come."""
        with self._changed:
            return self._is_over and self._held is None

    @property
    def waiting(self) -> int:
        with self._changed:
            return int(self._held is not None)


FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.1, 1.0
LATE = 1.6
"""Of the usual interval: a picture so much after the one before says that others are missing between."""
EARLY = 0.5
"""A picture that follows so soon after a late one tells that it was only late."""
USUAL = 0.75
"""Of the nominal interval: pictures closer together are a burst."""
LEAST_INTERVALS = 10


class MissingPictures:
    """Counts pictures that a camera dropped, from the times of those that came.

    The usual interval is the median of the last ones: a camera that is slower in dim light drops nothing.
    """

    def __init__(self) -> None:
        self.dropped = 0
        self.rate_hz = 30.0
        """Nominal."""
        self._intervals: deque[int] = deque(maxlen=61)
        self._last_ns: int | None = None
        self._perhaps = 0

    def note(self, monotonic_ns: int) -> None:
        if self._last_ns is not None:
            interval = monotonic_ns - self._last_ns
            if len(self._intervals) >= LEAST_INTERVALS:
                usual = max(statistics.median(self._intervals), USUAL * 1e9 / self.rate_hz)
                if interval >= EARLY * usual:
                    self.dropped += self._perhaps
                self._perhaps = round(interval / usual) - 1 if interval > LATE * usual else 0
            self._intervals.append(interval)
        self._last_ns = monotonic_ns

    def begin_anew(self) -> None:
        """After the camera was lost; what is missing since is its loss, not a drop."""
        self._last_ns, self._perhaps = None, 0


class PictureReader:
    """Reads until it is stopped, or a file is over. ``status`` tells how it goes."""

    def __init__(
        self,
        source: PictureSource,
        newest: NewestPicture,
        kept: KeptPictures,
        status: CaptureStatus,
        changed: Callable[[], None],
    ) -> None:
        """``changed`` is called at each change of the status."""
        self.missing = MissingPictures()
        self.is_recorded = source.name.startswith(("video:", "labels:"))
        """Played back at its own pace; its poses have the times of now, as those of a replayed glove."""
        self._source, self._newest, self._kept = source, newest, kept
        self._status, self._changed = status, changed
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="pictures", daemon=True)
        self._last_ns: int | None = None
        self._shift_ns: tuple[int, int] | None = None
        self._openings = 0

    def start(self) -> None:
        self._thread.start()

    def stop(self, within_s: float = 5.0) -> bool:
        """False when the camera's driver hangs."""
        self._stop.set()
        self._thread.join(within_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        pause_s = FIRST_PAUSE_S
        try:
            while not self._stop.is_set():
                try:
                    self._read_until_lost()
                except DeviceFinished as over:
                    self._say("streaming", str(over))
                    return
                except Exception as error:  # a driver is foreign code
                    pause_s = FIRST_PAUSE_S if self._status.state == "streaming" else 2 * pause_s
                    if not self._note_loss(error):
                        return
                    self._stop.wait(min(pause_s, LONGEST_PAUSE_S))
        finally:
            self._source.close()
            self._newest.end()

    def _read_until_lost(self) -> None:
        self._source.open()
        self.missing.rate_hz = self._source.rate_hz
        self._openings += 1
        self._status.reconnects = self._openings - 1
        self._say("streaming", f"{self._source.name} is open")
        while not self._stop.is_set():
            self._take(self._source.read())

    def _note_loss(self, error: Exception) -> bool:
        """Whether to open it again: a file that cannot be read will not come back."""
        said = reason_of(error)
        self._source.close()
        self._kept.begin_anew()
        self.missing.begin_anew()
        if self.is_recorded:
            self._say("lost", said)
            return False
        self._say("lost", f"{said}; trying to open it again")
        return True

    def _take(self, picture: Picture) -> None:
        if picture.pixels.ndim == 3:
            self._kept.keep_picture(self._source, picture)
        if self._last_ns is not None and picture.monotonic_ns <= self._last_ns:
            self._status.duplicates += 1
            return
        self._last_ns = picture.monotonic_ns
        self.missing.note(picture.monotonic_ns)
        monotonic_ns, wall_ns = self._now(picture)
        number = self._status.frames
        self._status.frame_sent(clock_ns())
        self._newest.put(NumberedPicture(number, picture, monotonic_ns, wall_ns))

    def _now(self, picture: Picture) -> tuple[int, int]:
        """The picture's times; of a recorded one the moment when it is due, which is waited for."""
        if not self.is_recorded:
            return picture.monotonic_ns, picture.wall_ns
        if self._shift_ns is None:
            began = clock_ns() - picture.monotonic_ns, wall_ns() - picture.monotonic_ns
            self._shift_ns = began
        due_ns = picture.monotonic_ns + self._shift_ns[0]
        self._stop.wait(max(0.0, (due_ns - clock_ns()) / 1e9))
        return due_ns, picture.monotonic_ns + self._shift_ns[1]

    def _say(self, state: str, sentence: str) -> None:
        if self._status.change(state, sentence):  # type: ignore[arg-type]
            self._changed()
