"""Videos on disk: every pixel as it came (FFV1 in Matroska), and beside it a table of time stamps.

``NAME.mkv`` and ``NAME.times.csv`` (``picture``, ``monotonic_ns``, ``wall_ns``): a container's own stamps are
rounded, and say nothing of the computer's clock. ``NAME.json`` says what it is of.

Videos of phones and other cameras are read too (``SUFFIXES``): upright, as the file says it was held, and
with the container's stamps, which count from the file's beginning and need not be even.

A preview is a small copy, to be looked at beside a take: a ZIP file without compression, with ``video.json``
and JPEG pictures from ``000000.jpg`` onwards. The pictures as they came stay in the video.
"""

from __future__ import annotations

import csv
import json
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from glovecal_client.encryption.kept_file import create_whole, is_encrypting, is_kept_encrypted
from glovecal_client.errors import BadEncryptionKey, DeviceError, DeviceFinished, DeviceLost, reason_of
from glovecal_client.pictures.encrypted_video import EncryptedVideo, VideoStream, open_stream
from glovecal_client.pictures.source import Picture, opencv

SUFFIX = ".mkv"
SUFFIXES = (SUFFIX, ".mp4", ".mov", ".m4v", ".webm", ".avi")
"""Of videos that are read; the first is what is written here."""
EVENLY = (".avi",)
"""Containers that hold a rate and no stamps."""
SAME_RATE = 1.1
"""Longest and shortest interval that count as an even rate, quotient."""
USUAL_HZ = 30.0
OF_COMPUTER = "times of the recording computer"
COLUMNS = ("picture", "monotonic_ns", "wall_ns")


def times_path(video: Path) -> Path:
    return video.with_suffix(".times.csv")


class VideoWriter:
    """Writes pictures of one size; a stamp is on disk with its picture. Raises DeviceError, OSError."""

    def __init__(self, path: Path, rate_hz: float) -> None:
        """``rate_hz`` is for players only. Raises DeviceError for another suffix, or a file that is there."""
        if path.suffix != SUFFIX:
            raise DeviceError(f"video {path} must end in {SUFFIX}: pictures are kept losslessly (FFV1)")
        for each in (path, times_path(path)):
            if each.exists():
                raise DeviceError(f"{each} exists already; name a new file")
        self.path: Path = path
        self.pictures: int = 0
        self._rate_hz = rate_hz
        self._cv2 = opencv()
        self._writer: Any = None
        self._encrypted: EncryptedVideo | None = None
        self._shape: tuple[int, ...] = ()
        self._times = times_path(path).open("x", encoding="utf-8", newline="")
        self._table = csv.writer(self._times)
        self._table.writerow(COLUMNS)

    def write(self, picture: Picture) -> None:
        if self._writer is None:
            self._begin(picture.pixels)
        if picture.pixels.shape != self._shape:
            raise DeviceError(f"a picture of {picture.pixels.shape} does not fit a video of {self._shape}")
        assert self._writer is not None
        self._writer.write(picture.pixels)
        if self._encrypted is not None and self._encrypted.problem:
            raise DeviceError(f"{self.path}: {self._encrypted.problem}")
        self._table.writerow([self.pictures, picture.monotonic_ns, picture.wall_ns])
        self._times.flush()
        self.pictures += 1

    def close(self) -> None:
        if self._writer is not None:
            self._writer.release()
            self._writer = None
        if self._encrypted is not None:
            self._encrypted.close()
        self._times.close()

    def _begin(self, pixels: np.ndarray) -> None:
        self._shape = pixels.shape
        height, width = pixels.shape[:2]
        code = self._cv2.VideoWriter.fourcc(*"FFV1")
        target = self.path
        if is_encrypting():
            self._encrypted = EncryptedVideo(self.path)
            target = self._encrypted.pipe
        self._writer = self._cv2.VideoWriter(
            str(target), self._cv2.CAP_FFMPEG, code, self._rate_hz, (width, height)
        )
        if self._encrypted is not None and self._writer.isOpened():
            self._encrypted.begin()
        if not self._writer.isOpened():
            raise DeviceError(
                f"{self.path} cannot be written: this OpenCV has no FFV1, or the folder is missing"
            )


@dataclass(frozen=True)
class VideoStamps:
    """When each picture of a video was taken."""

    times_ns: list[tuple[int, int]]
    """Monotonic and wall time."""
    of_this_computer: bool
    """Whether they are by the clock of the computer that filmed; else they count from the first picture."""
    sentence: str
    """Where they come from, and how even they are."""


class VideoFilePictures:
    """A video with its stamps: those of the table beside it, else its container's."""

    def __init__(self, path: Path) -> None:
        self.name: str = f"video:{path}"
        self._path = path
        self.about: dict[str, Any] = {}
        """What was said of it when it was recorded; empty where nothing is."""
        self.simulated = False
        self.rate_hz = 30.0
        self._cv2 = opencv()
        self._video: Any = None
        self._stream: VideoStream | None = None
        self._stamps: list[tuple[int, int]] = []

    @cached_property
    def stamps(self) -> VideoStamps:
        """Without a table all of the video is gone through once. Raises DeviceLost for what is no video."""
        if not times_path(self._path).exists():
            return self._stamps_of_container()
        imported = read_about(self._path).get("times")
        if isinstance(imported, str):
            return VideoStamps(read_times(self._path), False, imported)
        return VideoStamps(read_times(self._path), True, OF_COMPUTER)

    def open(self) -> None:
        self.close()
        self._stamps = self.stamps.times_ns
        self.about = read_about(self._path)
        self.simulated: bool = self.about.get("simulated") is True
        if len(self._stamps) > 1:
            span_s = (self._stamps[-1][0] - self._stamps[0][0]) / 1e9
            self.rate_hz: float = (len(self._stamps) - 1) / max(span_s, 1e-3)
        self._video, self._number = self._opened(), 0

    def _stamps_of_container(self) -> VideoStamps:
        video = self._opened()
        try:
            stated_hz = float(video.get(self._cv2.CAP_PROP_FPS))
            times_ms = []
            while video.grab():
                times_ms.append(float(video.get(self._cv2.CAP_PROP_POS_MSEC)))
            ended_ns = self._path.stat().st_mtime_ns
        finally:
            video.release()
            self._close_stream()
        if not times_ms:
            raise DeviceLost(f"{self._path} holds no picture that can be read")
        times_ms, sentence = _settled(times_ms, stated_hz, has_stamps=self._path.suffix.lower() not in EVENLY)
        began_ns = ended_ns - round(1e6 * times_ms[-1])  # a file is written last when its filming ends
        stamps = [(round(1e6 * at), began_ns + round(1e6 * at)) for at in times_ms]
        return VideoStamps(stamps, False, sentence)

    def _opened(self) -> Any:
        """Raises DeviceLost for what is no video."""
        try:
            video = self._capture()
        except self._cv2.error as error:
            raise DeviceLost(f"{self._path} cannot be read as a video") from error
        if not video.isOpened():
            video.release()
            self._close_stream()
            raise DeviceLost(f"{self._path} cannot be read as a video")
        return video

    def _capture(self) -> Any:
        try:
            if not is_kept_encrypted(self._path):
                return self._cv2.VideoCapture(str(self._path))
            self._stream = VideoStream(self._path)
        except BadEncryptionKey:
            raise
        except OSError as error:
            raise DeviceLost(f"{self._path} cannot be read: {reason_of(error)}") from error
        return open_stream(self._cv2, self._stream)

    def read(self) -> Picture:
        if self._video is None:
            raise DeviceLost(f"{self.name} is not open")
        is_there, pixels = self._video.read()
        if not is_there and self._number < len(self._stamps):
            raise DeviceFinished(
                f"{self.name} ends in the middle: {self._number} of {len(self._stamps)} pictures can be read",
                is_early=True,
            )
        if not is_there or self._number >= len(self._stamps):
            raise DeviceFinished(f"{self.name} is over after {self._number} pictures")
        monotonic_ns, wall_ns = self._stamps[self._number]
        self._number += 1
        return Picture(pixels, monotonic_ns, wall_ns)

    def close(self) -> None:
        video, self._video = self._video, None
        if video is not None:
            video.release()
        self._close_stream()

    def _close_stream(self) -> None:
        stream, self._stream = self._stream, None
        if stream is not None:
            stream.close()


def _settled(times_ms: list[float], stated_hz: float, *, has_stamps: bool) -> tuple[list[float], str]:
    """Times that begin at 0, and where they come from. Stamps that do not increase are none: then the rate
    that the file says counts, else the usual one."""
    steps = [later - before for before, later in pairwise(times_ms)]
    increasing = sum(step > 0 for step in steps)
    if has_stamps and increasing >= 0.9 * len(steps):
        shortest, longest = _ends([step for step in steps if step > 0] or [1e3 / USUAL_HZ])
        how = f"{1e3 * len(steps) / max(times_ms[-1] - times_ms[0], 1e-3):.2f} Hz"
        if longest > SAME_RATE * shortest + 1.0:  # stamps of some containers are whole milliseconds
            how = f"a variable rate, {1e3 / longest:.1f} to {1e3 / shortest:.1f} Hz"
        return [at - times_ms[0] for at in times_ms], f"the file's own times, {how}"
    is_credible = 1.0 <= stated_hz <= 1000.0
    rate_hz = stated_hz if is_credible else USUAL_HZ
    whose = "as its header says" if is_credible else "which is assumed: its header says none"
    return [1e3 * row / rate_hz for row in range(len(times_ms))], (
        f"the file has no times of its pictures: taken as even, {rate_hz:.2f} Hz, {whose}"
    )


def _ends(steps: list[float]) -> tuple[float, float]:
    """The 5th and the 95th percentile."""
    ordered = sorted(steps)
    return ordered[len(ordered) // 20], ordered[-1 - len(ordered) // 20]


def write_times(video: Path, times_ns: Sequence[tuple[int, int]]) -> None:
    """The table of stamps beside a video."""
    with times_path(video).open("w", encoding="utf-8", newline="") as stream:
        table = csv.writer(stream)
        table.writerow(COLUMNS)
        table.writerows([number, *stamp] for number, stamp in enumerate(times_ns))


def read_times(video: Path) -> list[tuple[int, int]]:
    """Monotonic and wall time of each picture, nanoseconds. Raises DeviceLost for a table that cannot be."""
    path = times_path(video)
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            rows = list(csv.DictReader(stream))
        return [(int(row[COLUMNS[1]]), int(row[COLUMNS[2]])) for row in rows]
    except OSError as error:
        raise DeviceLost(f"{video} has no time stamps: {path} cannot be read ({reason_of(error)})") from error
    except (KeyError, TypeError, ValueError) as error:
        raise DeviceLost(f"{path} must have the columns {', '.join(COLUMNS)}, whole nanoseconds") from error


def read_about(video: Path) -> dict[str, Any]:
    """What ``NAME.json`` says; empty where it is missing or says nothing."""
    try:
        about = json.loads(video.with_suffix(".json").read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return about if isinstance(about, dict) else {}


ABOUT = "video.json"
RATE_HZ, WIDTH, JPEG_QUALITY = 10.0, 480, 80
MOST_PICTURES = 20_000
"""Over half an hour."""


def picture_name(number: int) -> str:
    return f"{number:06d}.jpg"


def write_preview(video: Path, about: dict[str, Any]) -> Path:
    """``NAME.preview.zip`` beside ``NAME.mkv``; ``about`` as ``VideoRecording.describe`` wrote it.

    Raises DeviceLost for a video that cannot be read, DeviceError for one without pictures.
    """
    path = video.with_suffix(".preview.zip")
    cv2, source = opencv(), VideoFilePictures(video)
    source.open()
    times_s: list[float] = []
    path.unlink(missing_ok=True)
    try:
        with create_whole(path) as kept, zipfile.ZipFile(kept, "w", zipfile.ZIP_STORED) as file:
            while len(times_s) < MOST_PICTURES:
                try:
                    picture = source.read()
                except DeviceFinished:
                    break
                at_s = picture.monotonic_ns / 1e9
                if times_s and at_s < times_s[-1] + 1.0 / RATE_HZ - 0.01:
                    continue
                height, width = picture.pixels.shape[:2]
                share = min(1.0, WIDTH / width)
                size = (max(1, round(width * share)), max(1, round(height * share)))
                small = cv2.resize(picture.pixels, size, interpolation=cv2.INTER_AREA)
                _, jpeg = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
                file.writestr(picture_name(len(times_s)), jpeg.tobytes())
                times_s.append(at_s)
            if not times_s:
                raise DeviceError(f"{video} has no pictures")
            facts = {key: about[key] for key in ("source", "simulated", "computer")}
            file.writestr(ABOUT, json.dumps({**facts, "times_s": times_s}))
    except BaseException:
        path.unlink(missing_ok=True)
        raise
    finally:
        source.close()
    return path
