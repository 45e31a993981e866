"""A small copy of a video, to be looked at beside a take: JPEG pictures and their times in one file.

A ZIP file without compression: ``video.json`` and ``000000.jpg`` onwards. The pictures as they came stay in
the video.
"""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

from glovecal_client.errors import DeviceError, DeviceFinished
from glovecal_client.pictures.source import opencv
from glovecal_client.pictures.video_file import VideoFilePictures

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
    try:
        with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as file:
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
