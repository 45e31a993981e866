"""The service's way to cameras: processes that it started, and what all of them say over zenoh."""

from __future__ import annotations

import threading
from contextlib import ExitStack

import zenoh

from glovecal_client.queries import ask
from glovecal_client.session import open_client
from glovecal_service.camera.started_cameras import StartedCameras

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
