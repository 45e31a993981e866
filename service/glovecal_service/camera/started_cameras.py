"""Cameras that this service started, each a process of its own that ends with the service."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections import deque
from dataclasses import dataclass

from glovecal_service.camera.camera_settings import CameraSettings
from glovecal_service.store.errors import Conflict

MOST_AT_ONCE = 4
ENDS_WITHIN_S = 10.0
_MOST_SENTENCES, _LONGEST_SENTENCE = 50, 500


@dataclass(frozen=True)
class StartedCamera:
    glove: str
    source: str
    is_on: bool
    sentence: str
    """The last that it said."""


class _Process:
    def __init__(self, settings: CameraSettings) -> None:
        self.settings = settings
        command = [sys.executable, "-P", "-m", "glovecal_service.camera.process", settings.text()]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
        )
        self._said: deque[str] = deque(maxlen=_MOST_SENTENCES)
        self._listening = threading.Thread(target=self._listen, daemon=True)
        self._listening.start()

    @property
    def is_on(self) -> bool:
        return self._process.poll() is None

    @property
    def sentence(self) -> str:
        return self._said[-1] if self._said else ""

    def end(self) -> None:
        """It is killed where its camera hangs."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        try:
            self._process.wait(ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            self._said.append(f"the camera hangs; its process was ended after {ENDS_WITHIN_S:g} s")
        self._listening.join(ENDS_WITHIN_S)

    def _listen(self) -> None:
        assert self._process.stderr is not None
        with self._process.stderr as said:
            for line in said:
                if text := line.decode(errors="replace").strip():
                    self._said.append(text[:_LONGEST_SENTENCE])


class StartedCameras:
    """By the glove that each publishes. From any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._processes: dict[str, _Process] = {}

    def start(self, settings: CameraSettings) -> StartedCamera:
        """Raises Conflict while one goes on under the same name, or too many do."""
        with self._lock:
            running = [name for name, process in self._processes.items() if process.is_on]
            if settings.glove in running:
                raise Conflict(f"a camera publishes glove {settings.glove} already; stop it first")
            if len(running) >= MOST_AT_ONCE:
                raise Conflict(f"{MOST_AT_ONCE} cameras are on already: {', '.join(running)}; stop one first")
            self._processes[settings.glove] = _Process(settings)
            return self._state(settings.glove)

    def states(self) -> dict[str, StartedCamera]:
        """Also of those that have ended since."""
        with self._lock:
            return {glove: self._state(glove) for glove in self._processes}

    def stop(self, glove: str) -> StartedCamera | None:
        """End it; None where none of that name was started here."""
        with self._lock:
            process = self._processes.get(glove)
        if process is None:
            return None
        if process.is_on:
            process.end()
        with self._lock:
            return self._state(glove)

    def close(self) -> None:
        for glove in list(self._processes):
            self.stop(glove)

    def _state(self, glove: str) -> StartedCamera:
        process = self._processes[glove]
        return StartedCamera(glove, process.settings.source, process.is_on, process.sentence)
