"""``serve`` as a user runs it: one banner, parts that come back when killed, a clean end."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from realtime_support import eventually, free_endpoint

from glovecal_client.errors import NoAnswer
from glovecal_client.keys import all_services
from glovecal_client.queries import ask_json
from glovecal_client.session import open_client

SERVE = "import sys; from glovecal_service.cli.command import main; sys.argv = ['glovecal', 'serve']; main()"


def free_port() -> int:
    return int(free_endpoint().rpartition(":")[2])


def start(data: Path, endpoint: str, port: int) -> subprocess.Popen[str]:
    environment = os.environ | {
        "GLOVECAL_DATA": str(data),
        "GLOVECAL_ZENOH": endpoint,
        "GLOVECAL_PORT": str(port),
    }
    return subprocess.Popen(
        [sys.executable, "-c", SERVE],
        env=environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


@pytest.fixture
def serving(tmp_path: Path) -> Iterator[tuple[subprocess.Popen[str], str, int]]:
    endpoint, port = free_endpoint(), free_port()
    process = start(tmp_path / "data", endpoint, port)
    try:
        yield process, endpoint, port
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate(timeout=120)


def children(process: subprocess.Popen[str]) -> list[int]:
    return [int(pid) for pid in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()]


def answers(endpoint: str) -> int:
    """The process id the real-time process tells, 0 while it does not answer."""
    try:
        with open_client([endpoint], wait_s=0) as session:
            return int(ask_json(session, all_services("lab").removesuffix("alive") + "status")["process"])
    except NoAnswer:
        return 0


def is_ready(port: int) -> bool:
    try:
        return httpx.get(f"http://127.0.0.1:{port}/v1/health/ready").status_code == 200
    except httpx.TransportError:
        return False


def web_process(process: subprocess.Popen[str], port: int) -> int:
    """The child that holds the REST port."""
    wanted = f"{port:04X}"
    inodes = {
        line.split()[9]
        for line in Path("/proc/net/tcp").read_text().splitlines()[1:]
        if line.split()[1].endswith(wanted) and line.split()[3] == "0A"
    }
    for child in children(process):
        links = [os.readlink(entry) for entry in Path(f"/proc/{child}/fd").iterdir() if entry.is_symlink()]
        if any(f"socket:[{inode}]" in links for inode in inodes):
            return child
    return 0


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_each_part_survives_the_death_of_the_others(serving: tuple[subprocess.Popen[str], str, int]) -> None:
    process, endpoint, port = serving
    assert process.stdout is not None
    banner = [process.stdout.readline() for _ in range(4)]
    assert banner[0].startswith("Glovecal is running")
    assert f"http://127.0.0.1:{port}" in banner[1]
    assert endpoint in banner[2]
    assert is_ready(port)
    first = answers(endpoint)
    web = web_process(process, port)
    assert len({first, web, 0}) == 3

    os.kill(web, signal.SIGKILL)
    assert answers(endpoint) == first
    eventually(lambda: is_ready(port), "web is back")

    os.kill(first, signal.SIGKILL)
    assert is_ready(port)
    eventually(lambda: answers(endpoint) not in (0, first), "real time is back")

    all_children = children(process)
    process.send_signal(signal.SIGTERM)
    assert process.wait(120) == 0
    eventually(lambda: not any(Path(f"/proc/{child}").exists() for child in all_children), "nothing is left")


@pytest.mark.parametrize("taken", ["REST", "zenoh"])
def test_a_taken_port_is_one_sentence(tmp_path: Path, taken: str) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        endpoint = f"tcp/127.0.0.1:{port}" if taken == "zenoh" else free_endpoint()
        process = start(tmp_path, endpoint, port if taken == "REST" else free_port())
        said, complained = process.communicate(timeout=120)
    assert process.returncode == 1
    assert said == ""
    assert len(complained.strip().splitlines()) == 1
    assert f"{taken} cannot listen on 127.0.0.1:{port}" in complained
