"""The product on Linux with what Windows lacks taken away (``shim/sitecustomize.py``).

What fails here cannot work on Windows. That the rest works there is not proved.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from glovecal_client.errors import NoAnswer, ServiceError
from glovecal_client.keys import all_services
from glovecal_client.rest import RestClient
from glovecal_client.session import ask_json, open_client
from glovecal_models.takes.take import Take
from glovecal_models.takes.write_table import write_takes
from glovecal_service.demo.processes import demo_place

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="takes away from Linux what Windows lacks")

SHIM = Path(__file__).parent / "shim"
DEVICES = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\.|$)", re.IGNORECASE)
TAKE_BACK = """
from glovecal_service.jobs.owner import Owner
from glovecal_service.settings import Settings
from glovecal_service.store.store import Store
with Store.open(Settings()) as store:
    owner = Owner(Settings().data / "owners")
    print(owner.take_back_from_dead(store))
    owner.close()
"""
BRIEF = {"samples": 100, "folds": 0}
KEYS = """
import sys, types
from glovecal_service.operating_system import single_keys
sys.stdin = types.SimpleNamespace(isatty=lambda: True)
with single_keys() as key:
    print(*(key(0.05) or "none" for _ in range(4)))
"""
LONGEST_PATH = 150
"""Of 260 characters, within the data folder."""


class Computer:
    """A folder, and programs in it that see Windows."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.place = demo_place(folder)
        mine = {name: value for name, value in self.place.environment.items() if name != "PYTHONUNBUFFERED"}
        self.environment = mine | {
            "PYTHONPATH": str(SHIM),
            "WINDOWS_LIKE_FOLDER": str(folder),
            "TMPDIR": str(folder),
            "PYTHONIOENCODING": "cp1252",
            "GLOVECAL_WORKERS": "1",
        }
        self.running: list[subprocess.Popen[str]] = []

    def start(self, *command: object) -> subprocess.Popen[str]:
        """In a group of its own, as on Windows to be stopped by Ctrl-Break."""
        process = subprocess.Popen(
            [sys.executable, "-P", *map(str, command)],
            cwd=self.folder,
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="cp1252",
            process_group=0,
        )
        self.running.append(process)
        return process

    def glovecal(self, *arguments: object) -> subprocess.Popen[str]:
        return self.start("-m", "glovecal_service.cli.command", *arguments)

    def run(self, *arguments: object) -> str:
        return self._finished(self.glovecal(*arguments))

    def python(self, code: str) -> str:
        return self._finished(self.start("-c", code))

    def _finished(self, process: subprocess.Popen[str]) -> str:
        said = process.communicate(timeout=300)[0]
        assert process.returncode == 0, said
        return said

    def processes(self) -> list[int]:
        """That are alive under the shim."""
        return [
            int(entry.name)
            for entry in (self.folder / "windows-like-processes").iterdir()
            if Path("/proc", entry.name, "stat").exists() and not _is_zombie(entry.name)
        ]

    def noted(self) -> str:
        """What was refused, and what did not stop when it was asked to."""
        log = self.folder / "windows-like.log"
        return log.read_text(encoding="utf-8") if log.exists() else ""


def _is_zombie(process: str) -> bool:
    try:
        return Path("/proc", process, "stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except OSError:
        return True


def eventually(condition: Callable[[], Any], what: str, within_s: float = 120.0) -> Any:
    until = time.monotonic() + within_s
    while not (found := condition()):
        assert time.monotonic() < until, f"not within {within_s} s: {what}"
        time.sleep(0.05)
    return found


@pytest.fixture
def computer(tmp_path: Path) -> Iterator[Computer]:
    computer = Computer(tmp_path)
    yield computer
    for process in computer.running:
        if process.poll() is None:
            process.kill()
        process.communicate(timeout=60)
    try:
        eventually(lambda: not computer.processes(), "no process is left")
    finally:
        for number in computer.processes():
            os.kill(number, signal.SIGKILL)


@pytest.mark.slow
def test_the_demo_in_small(computer: Computer) -> None:
    """Capture, recording, import of a reference, training and live poses."""
    said = computer.run("demo", "--smoke")
    assert re.search(r"error [\d.]+ degrees raw, [\d.]+ linear; 600 frames sent live, \d+ poses", said), said
    assert computer.noted() == ""


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_the_whole_demo(computer: Computer) -> None:
    said = computer.run("demo", "--seed", "2", "--effect", "hysteresis")
    assert "hysteresis" in said
    assert computer.noted() == ""


@pytest.fixture
def service(computer: Computer) -> Iterator[RestClient]:
    with RestClient(computer.place.url) as client:
        yield client


def test_two_hostile_restarts_and_a_backup(computer: Computer, service: RestClient) -> None:
    computer.environment["GLOVECAL_URL"] = computer.place.url
    serve = computer.glovecal("serve")
    eventually(lambda: is_ready(service, serve), "service is ready")
    take = write_takes([_take()], computer.folder / "takes.csv")[0]
    said = computer.run("take", "import", take, "--subject", "anna")
    assert "poses" in said
    job = service.post("/models/train", {"subject": "anna", **BRIEF})["id"]
    eventually(lambda: service.get(f"/jobs/{job}")["state"] == "running", "training has begun")

    os.killpg(serve.pid, signal.SIGKILL)  # its console is closed in the middle of a training
    serve.communicate(timeout=60)
    assert computer.python(TAKE_BACK) == "1\n"
    serve = computer.glovecal("serve")
    eventually(lambda: is_ready(service, serve), "service is ready again")
    model = service.wait_for_job(job)["result"]["model"]
    assert service.get(f"/jobs/{job}")["attempt"] == 2

    first = real_time(computer.place.zenoh)
    os.kill(first, signal.SIGKILL)
    eventually(lambda: real_time(computer.place.zenoh) not in (0, first), "real time is back")
    serve.kill()  # TerminateProcess of the one that supervises
    serve.communicate(timeout=60)
    eventually(lambda: not computer.processes(), "its processes follow")

    backup = computer.folder / "backup"
    shutil.copytree(computer.folder / "glovecal-data", backup)
    del computer.environment["GLOVECAL_URL"]
    computer.environment["GLOVECAL_DATA"] = str(backup)
    assert model[:12] in computer.run("model", "list")
    assert computer.noted() == ""
    for path in backup.rglob("*"):
        _check_name(path.relative_to(backup))


def _check_name(path: Path) -> None:
    assert len(str(path)) < LONGEST_PATH
    assert path.name == path.name.rstrip(". ")
    assert not set(path.name) & set('<>:"\\|?*')
    assert not DEVICES.match(path.name)


def _take() -> Take:
    """Two joints, a sensor each."""
    time_s = np.arange(600) / 60
    angles = np.column_stack([45 + 40 * np.sin(time_s), 50 + 45 * np.cos(1.3 * time_s)])
    noise = np.random.default_rng(0).normal(0, 0.5, (2, *angles.shape))
    joints = ("I_MCP", "I_PIP")
    return Take(
        "poses", "first", joints, time_s, 60 + 1.4 * angles + noise[0], joints, time_s, angles + noise[1]
    )


def is_ready(service: RestClient, process: subprocess.Popen[str]) -> bool:
    if process.poll() is not None:
        pytest.fail(process.communicate()[0])
    try:
        service.get("/health/ready")
    except ServiceError:
        return False
    return True


def real_time(endpoint: str) -> int:
    """The process id that real time tells, 0 while it does not answer."""
    try:
        with open_client([endpoint], wait_s=0) as session:
            return int(ask_json(session, all_services("lab").removesuffix("alive") + "status")["process"])
    except NoAnswer:
        return 0


def test_single_keys_from_a_console(computer: Computer) -> None:
    """A special key, such as an arrow, is two characters and none of ours."""
    computer.environment["WINDOWS_LIKE_KEYS"] = "a\xe0Hq"
    assert computer.python(KEYS) == "a none q none\n"
