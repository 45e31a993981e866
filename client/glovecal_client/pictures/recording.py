"""A video beside a take: pictures of a source to disk, in a thread of its own, until it is stopped.

``python -m glovecal_client.pictures.recording SOURCE FILE.mkv`` is the same as a process of its own: a
camera's driver may hang or crash, and then only this does. It films until its standard input ends, which is
also when the program that started it dies, and leaves ``FILE.json`` beside the video.
"""

from __future__ import annotations

import json
import sys
import threading
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from glovecal_client.clock import computer_id
from glovecal_client.errors import ClientError, reason_of
from glovecal_client.pictures.source import PictureSource, build_source
from glovecal_client.pictures.video_file import VideoWriter
from glovecal_client.program import leave_signals_to_the_parent, run_command

if TYPE_CHECKING:
    from typing_extensions import Self  # the client runs on Python 3.10


STOPS_WITHIN_S = 10.0
NOT_ENDED = "the recording was not ended; its pictures up to then are there"


class VideoRecording:
    """Records from ``with`` on. What ends it early stands in ``problem``; pictures so far are kept."""

    def __init__(self, source: PictureSource, path: Path) -> None:
        """Raises DeviceError for a file that cannot be."""
        self.problem = ""
        self._source, self._path = source, path
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="video", daemon=True)
        self._writer: VideoWriter | None = None

    def __enter__(self) -> Self:
        """Raises DeviceLost when there is no camera, DeviceError when the file is there already."""
        self._source.open()
        try:
            self._writer = VideoWriter(self._path, self._source.rate_hz)
        except BaseException:
            self._source.close()
            raise
        describe_video(self._path, self._source, 0, NOT_ENDED)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def stop(self) -> None:
        """End it; harmless when it has ended."""
        self._stop.set()
        self._thread.join(STOPS_WITHIN_S)
        self._source.close()
        if self._writer is not None:
            self._writer.close()

    @property
    def pictures(self) -> int:
        return 0 if self._writer is None else self._writer.pictures

    def describe(self, **facts: Any) -> Path:
        """End it and write ``NAME.json`` beside it: what it is of, whose clock its stamps are; its path."""
        self.stop()
        return describe_video(self._path, self._source, self.pictures, self.problem, **facts)

    def _run(self) -> None:
        assert self._writer is not None
        try:
            while not self._stop.is_set():
                self._writer.write(self._source.read())
        except (ClientError, OSError) as error:
            self.problem: str = reason_of(error)


def describe_video(video: Path, source: PictureSource, pictures: int, problem: str, **facts: Any) -> Path:
    """Write ``NAME.json`` beside ``NAME.mkv``; its path. First when the video begins: a killed one says too
    that it was drawn."""
    path = video.with_suffix(".json")
    document = {
        "video": video.name, "source": source.name, "simulated": source.simulated,
        "pictures": pictures, "computer": computer_id(), "problem": problem, **facts,
    }  # fmt: skip
    path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    return path


def main(source: str, file: str) -> int:
    """0, or 1 with a sentence on standard error when there is no camera or no place."""
    leave_signals_to_the_parent()
    try:
        with VideoRecording(build_source(source), Path(file)) as video:
            sys.stdin.buffer.read()
        video.describe()
    except (ClientError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    run_command(lambda: main(*sys.argv[1:]))
