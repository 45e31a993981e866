"""The one video that the service films: begun before a recording, ended after it, kept in the data folder."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

from glovecal_client.clock import clock_ns
from glovecal_client.errors import ClientError
from glovecal_client.pictures.video_file import times_path, write_preview
from glovecal_models.documents import read_json
from glovecal_models.errors import BadInput
from glovecal_service.store.blobs import require_room
from glovecal_service.store.errors import Conflict, NotFound

BEGINS_WITHIN_S = 10.0
ENDS_WITHIN_S = 20.0
LOOK_S = 0.05


@dataclass(frozen=True)
class FilmState:
    source: str
    file: Path
    is_on: bool
    pictures: int
    problem: str
    """Why it ended early; pictures so far are kept."""


class Filming:
    """One at a time. From any thread."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._source = ""
        self._file = folder

    def start(self, source: str) -> FilmState:
        """Raises Conflict while another goes on, StorageFull, BadInput with the camera's complaint."""
        with self._lock:
            if self._process is not None and self._process.poll() is None:
                raise Conflict(f"{self._source} films already; end that video first")
            self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            require_room(self._folder)
            name = time.strftime("%Y%m%d-%H%M%S") + f"-{clock_ns() % 1000:03d}"
            self._source, self._file = source, self._folder / f"{name}.mkv"
            command = [
                sys.executable,
                "-P",
                "-m",
                "glovecal_client.pictures.recording",
                source,
                str(self._file),
            ]
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
            )
            until = time.monotonic() + BEGINS_WITHIN_S
            while not self._pictures():
                if self._process.poll() is not None or time.monotonic() > until:
                    raise BadInput(f"{source} does not film: {self._end()}")
                time.sleep(LOOK_S)
            return self._state()

    def state(self) -> FilmState | None:
        """None before the first video."""
        with self._lock:
            return None if self._process is None else self._state()

    def stop(self) -> tuple[FilmState, Path]:
        """End it; its preview, to be removed by the caller. Raises NotFound, BadInput."""
        with self._lock:
            if self._process is None:
                raise NotFound("nothing was filmed since the service started")
            said = self._end()
            described = self._file.with_suffix(".json")
            try:
                about = read_json(described.read_bytes(), described.name)
                preview = write_preview(self._file, about)
            except (OSError, ValueError, ClientError) as error:
                raise BadInput(
                    f"the video {self._file.name} cannot be shown: {said or 'it was not written to its end'}"
                ) from error
            return self._state(about["problem"]), preview

    def close(self) -> None:
        with self._lock:
            self._end()

    def _end(self) -> str:
        """What the process had to say."""
        if self._process is None:
            return ""
        try:
            _, said = self._process.communicate(timeout=ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            _, said = self._process.communicate()
            return f"the camera hangs; its process was ended after {ENDS_WITHIN_S:g} s"
        except ValueError:  # ended before
            return ""
        return said.decode(errors="replace").strip()[-300:]

    def _pictures(self) -> int:
        try:
            return max(0, times_path(self._file).read_bytes().count(b"\n") - 1)
        except OSError:
            return 0

    def _state(self, problem: str = "") -> FilmState:
        is_on = self._process is not None and self._process.poll() is None
        return FilmState(self._source, self._file, is_on, self._pictures(), problem)
