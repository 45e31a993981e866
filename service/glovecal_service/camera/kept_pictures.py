"""What is kept of the pictures: all as they came (FFV1), the labels of those tracked, or nothing.

A file for each stretch without an interruption. A disk that is full, or another problem, is said and counted,
and the poses go on.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np

from glovecal_client.capture.computer import computer_id
from glovecal_client.clock import clock_ns
from glovecal_client.errors import ClientError
from glovecal_client.pictures.label_file import LabelWriter
from glovecal_client.pictures.recording import NOT_ENDED, describe_video
from glovecal_client.pictures.source import Picture, PictureSource
from glovecal_client.pictures.video_file import VideoWriter
from glovecal_client.private_files import PRIVATE_FOLDER
from glovecal_service.camera.camera_settings import Keep
from glovecal_service.plain import reason_of

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
