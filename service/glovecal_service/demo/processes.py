"""The demo's processes: a real service and real capture daemons, as a user would start them."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from glovecal_client.errors import ServiceError
from glovecal_client.rest import RestClient
from glovecal_service.operating_system import ask_to_stop, start_process

START_PATIENCE_S = 90.0
STOP_PATIENCE_S = 15.0


@dataclass(frozen=True)
class DemoPlace:
    """Where one demo lives: its folder and its own free ports on loopback."""

    folder: Path
    zenoh: str
    port: int

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    @property
    def environment(self) -> dict[str, str]:
        """What the demo's processes are told; nothing of a user's own service is touched."""
        mine = {name: value for name, value in os.environ.items() if not name.startswith("GLOVECAL_")}
        return mine | {
            "GLOVECAL_DATA": str(self.folder / "glovecal-data"),
            "GLOVECAL_ZENOH": self.zenoh,
            "GLOVECAL_HOST": "127.0.0.1",
            "GLOVECAL_PORT": str(self.port),
        }


def demo_place(folder: Path) -> DemoPlace:
    """A place with two ports that are free now."""
    return DemoPlace(folder, f"tcp/127.0.0.1:{_free_port()}", _free_port())


@contextmanager
def running_service(place: DemoPlace) -> Iterator[RestClient]:
    """``glovecal serve`` as a process, ready, and a client of it; stopped at the end of the block."""
    log = place.folder / "service.log"
    with log.open("wb") as stream:
        process = start_process([*_glovecal(), "serve"], place.environment, stream)
    try:
        with RestClient(place.url) as service:
            _wait_until_ready(service, process, log)
            yield service
    finally:
        stop(process)


@contextmanager
def running_capture(
    place: DemoPlace,
    *,
    glove: str,
    subject: str,
    wearing: str,
    options: Mapping[str, str],
    device: str = "simulated",
) -> Iterator[subprocess.Popen[bytes]]:
    """``glovecal capture`` as a process; stopped at the end of the block."""
    command = [*_glovecal(), "capture", "--device", device]
    command += ["--glove", glove, "--subject", subject, "--wearing", wearing]
    for key, value in options.items():
        command += ["--option", f"{key}={value}"]
    with (place.folder / "capture.log").open("ab") as stream:
        process = start_process(command, place.environment, stream)
    try:
        yield process
    finally:
        stop(process)


def stop(process: subprocess.Popen[bytes]) -> None:
    """Ask a process to stop, and insist when it does not."""
    if process.poll() is None:
        ask_to_stop(process)
        try:
            process.wait(STOP_PATIENCE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _wait_until_ready(service: RestClient, process: subprocess.Popen[bytes], log: Path) -> None:
    until = time.monotonic() + START_PATIENCE_S
    while True:
        try:
            service.get("/health/ready")
            return
        except ServiceError as error:
            if process.poll() is not None or time.monotonic() > until:
                last = log.read_text(encoding="utf-8", errors="replace").strip().splitlines()[-3:]
                raise ServiceError(
                    503, "Service did not start", " / ".join(last) or "it said nothing"
                ) from error
        time.sleep(0.1)


def _glovecal() -> list[str]:
    return [sys.executable, "-P", "-m", "glovecal_service.cli.command"]


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]
