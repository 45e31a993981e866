"""The thread that reads pictures: stamps checked, kept, handed on; a camera that was lost is opened again."""

from __future__ import annotations

import statistics
import threading
from collections import deque
from collections.abc import Callable

from glovecal_client.capture.status import CaptureStatus
from glovecal_client.clock import clock_ns, wall_ns
from glovecal_client.errors import DeviceFinished, reason_of
from glovecal_client.pictures.source import Picture, PictureSource
from glovecal_service.camera.kept_pictures import KeptPictures
from glovecal_service.camera.newest_picture import NewestPicture, NumberedPicture

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
