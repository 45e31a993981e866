"""The service's way to cameras: processes that it started and that end with it, and zenoh for all."""

from __future__ import annotations

import threading
from contextlib import ExitStack
from dataclasses import dataclass

import zenoh

from glovecal_client.session import ask, open_client
from glovecal_service.camera.camera_settings import CameraSettings
from glovecal_service.child_process import ChildProcess
from glovecal_service.store.errors import Conflict

MOST_AT_ONCE = 4


@dataclass(frozen=True)
class StartedCamera:
    glove: str
    source: str
    is_on: bool
    sentence: str
    """The last that it said."""


class StartedCameras:
    """By the glove that each publishes. From any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._processes: dict[str, tuple[CameraSettings, ChildProcess]] = {}

    def start(self, settings: CameraSettings) -> StartedCamera:
        """Raises Conflict while one goes on under the same name, or too many do."""
        with self._lock:
            running = [name for name, (_, process) in self._processes.items() if process.is_on]
            if settings.glove in running:
                raise Conflict(f"a camera publishes glove {settings.glove} already; stop it first")
            if len(running) >= MOST_AT_ONCE:
                raise Conflict(f"{MOST_AT_ONCE} cameras are on already: {', '.join(running)}; stop one first")
            process = ChildProcess("glovecal_service.camera.process", settings.text(), what="the camera")
            self._processes[settings.glove] = settings, process
            return self._state(settings.glove)

    def states(self) -> dict[str, StartedCamera]:
        """Also of those that have ended since."""
        with self._lock:
            return {glove: self._state(glove) for glove in self._processes}

    def stop(self, glove: str) -> StartedCamera | None:
        """End it; None where none of that name was started here."""
        with self._lock:
            if glove not in self._processes:
                return None
            process = self._processes[glove][1]
        process.end()
        with self._lock:
            return self._state(glove)

    def close(self) -> None:
        for glove in list(self._processes):
            self.stop(glove)

    def _state(self, glove: str) -> StartedCamera:
        settings, process = self._processes[glove]
        return StartedCamera(glove, settings.source, process.is_on, process.sentence)


ROUTER_WITHIN_S, ANSWER_WITHIN_S = 1.0, 2.0


class CameraAccess:
    """One zenoh session, opened when it is first needed: pictures are asked for many times a second."""

    def __init__(self, endpoint: str) -> None:
        self.started = StartedCameras()
        self._endpoint = endpoint
        self._lock = threading.Lock()
        self._kept = ExitStack()
        self._session: zenoh.Session | None = None

    def ask(self, selector: str, *, timeout_s: float = ANSWER_WITHIN_S) -> list[zenoh.Sample]:
        """Raises NoAnswer, QueryRefused."""
        with self._lock:
            if self._session is None:
                self._session = self._kept.enter_context(
                    open_client((self._endpoint,), wait_s=ROUTER_WITHIN_S)
                )
            session = self._session
        return ask(session, selector, timeout_s=timeout_s)

    def close(self) -> None:
        """End the cameras that were started here."""
        self.started.close()
        with self._lock:
            self._session = None
            self._kept.close()
