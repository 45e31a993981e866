"""A real S3 server of our own: nanio, whose buckets are folders, on a free port of this computer."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import httpx
from realtime_support import free_endpoint

BUCKET = "glovecal"
KEY, SECRET = "glovecal", "not-secret-at-all"


class S3Server:
    """What it acknowledged is in ``folder``, also after a kill."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / BUCKET).mkdir(parents=True, exist_ok=True)
        self.endpoint = f"http://{free_endpoint().removeprefix('tcp/')}"
        self._process: subprocess.Popen[bytes] | None = None
        self.start()

    @property
    def environment(self) -> dict[str, str]:
        """For programs that use it."""
        return {
            "AWS_ENDPOINT_URL": self.endpoint, "AWS_ALLOW_HTTP": "true", "AWS_REGION": "us-east-1",
            "AWS_ACCESS_KEY_ID": KEY, "AWS_SECRET_ACCESS_KEY": SECRET,
        }  # fmt: skip

    def start(self) -> None:
        host, _, port = self.endpoint.removeprefix("http://").rpartition(":")
        command = [sys.executable, "-m", "nanio", "serve", "--data-dir", str(self.folder), "--host", host]
        self._process = subprocess.Popen(
            [*command, "--port", port, "--log-level", "error", "--no-access-log"],
            env=os.environ | {"NANIO_ACCESS_KEY": KEY, "NANIO_SECRET_KEY": SECRET},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        until = time.monotonic() + 120
        while not self._answers():
            assert self._process.poll() is None, "it ended"
            assert time.monotonic() < until, "it does not answer"
            time.sleep(0.05)

    def _answers(self) -> bool:
        try:
            return bool(httpx.get(self.endpoint, timeout=2.0).status_code)
        except httpx.TransportError:
            return False

    def kill(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None

    def halt(self) -> None:
        """It still accepts, and never answers."""
        assert self._process is not None
        self._process.send_signal(signal.SIGSTOP)

    def go_on(self) -> None:
        assert self._process is not None
        self._process.send_signal(signal.SIGCONT)
