"""What the fault study disturbs: a service as ``glovecal serve`` runs it, two captures with their gloves, a
client that writes, one that records, one that watches poses. All are processes of their own but the clients.
"""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import psutil
from fault_link import NetworkLink
from free_ports import free_port

from glovecal_client.clock import clock_ns
from glovecal_client.errors import ClientError
from glovecal_client.pose_subscriber import PoseSubscriber
from glovecal_client.rest import NoService, Refused, RestClient
from glovecal_client.session import open_client
from glovecal_models.calibration.artifact import dump
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take
from glovecal_service.emulators.catalogue import PROTOCOLS
from glovecal_service.emulators.glove import Faults
from glovecal_service.emulators.hand import MovingHand
from glovecal_service.emulators.ports import Emulation
from glovecal_service.emulators.pseudo_terminal import PseudoTerminal
from glovecal_service.settings import Settings
from glovecal_service.store import Store

GLOVES = ("left", "right")
PROTOCOL = {"left": "lucidglove", "right": "homunculus"}
SITE, SUBJECT, LAYOUT = "lab", "anna", "lucidglove"
STARTED_WITHIN_S = 120.0
DISK_MB = 64
HERE = Path(__file__).resolve().parent


def eventually(condition: Callable[[], Any], what: str, within_s: float = STARTED_WITHIN_S) -> Any:
    """The first true value of ``condition``. Raises TimeoutError."""
    end = time.monotonic() + within_s
    while not (value := condition()):
        if time.monotonic() > end:
            raise TimeoutError(f"not within {within_s:g} s: {what}")
        time.sleep(0.02)
    return value


class Program:
    """A process that is started again when it is gone and wanted, and ended with all its children."""

    def __init__(self, command: list[str], log: Path, environment: dict[str, str]) -> None:
        self._command, self._log, self._environment = command, log, environment
        self._process: subprocess.Popen[bytes] | None = None
        self.wanted = False

    def start(self) -> None:
        """Where it does not run already."""
        if self._process is None or self._process.poll() is not None:
            with self._log.open("ab") as output:
                self._process = subprocess.Popen(
                    self._command, env=self._environment, stdout=output, stderr=output, start_new_session=True
                )

    @property
    def process(self) -> psutil.Process | None:
        if self._process is None or self._process.poll() is not None:
            return None
        with suppress(psutil.Error):
            return psutil.Process(self._process.pid)
        return None

    def kill(self) -> None:
        """With kill -9, its children left alone."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()

    def end(self, within_s: float = 0.0) -> None:
        """Asked first if ``within_s`` allows; whatever it started is gone afterwards."""
        self.wanted = False
        if self._process is None:
            return
        if within_s:
            with suppress(subprocess.TimeoutExpired):
                self._process.terminate()
                self._process.wait(within_s)
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()


@dataclass
class Writes:
    """What the client asked for and what it was promised: nothing but an answer is a promise."""

    acknowledged: dict[str, str] = field(default_factory=dict)
    """Subjects and their titles."""
    unanswered: int = 0
    refused: dict[int, int] = field(default_factory=dict)
    """How often each status."""
    last_ns: int = 0
    """When the newest acknowledged write was asked for, ``clock_ns``."""


@dataclass
class RecordingAsked:
    id: str
    glove: str
    stop_asked_ns: int = 0
    """When its end was asked for first, ``clock_ns``; 0: not yet."""


class World:
    """Started by ``with``; at its end nothing runs and nothing is mounted any more, whatever happened."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.folder, self.seed = folder, seed
        self.router_port, self.web_port = free_port(), free_port()
        self.data, self.captured = folder / "service", folder / "captured"
        self.settings = Settings(
            data=self.data, database=None, artifacts=None, zenoh=f"tcp/127.0.0.1:{self.router_port}",
            port=self.web_port, site=SITE, site_file=None, studio=False,
        )  # fmt: skip
        self.url = f"http://127.0.0.1:{self.web_port}"
        self.writes = Writes()
        self.recordings: list[RecordingAsked] = []
        self.small_disks: tuple[Path, ...] = ()
        """Those that can be filled: none where nothing may be mounted."""
        self.told: list[str] = []
        """What a client was answered that it must never be."""
        self._running = ExitStack()
        self._stopping = threading.Event()
        self._recording = threading.Event()
        self._clients: list[threading.Thread] = []

    def __enter__(self) -> World:
        try:
            self._start()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        for client in self._clients:
            client.join(30)
        self._running.close()

    def _start(self) -> None:
        for folder in (self.data, self.captured):
            folder.mkdir(parents=True)
        if self._mounted(self.data) and self._mounted(self.captured):
            self.small_disks = (self.data, self.captured)
        self._store_a_model()
        self.links = {glove: NetworkLink(self.router_port, self.seed) for glove in GLOVES}
        for link in self.links.values():
            self._running.callback(link.close)
        self.clock_file = self.folder / "clock"
        self.set_clock_by(0.0)
        self.gloves = {
            glove: self._running.enter_context(self._emulated(glove, number))
            for number, glove in enumerate(GLOVES)
        }
        self.programs = self._programs()
        for program in self.programs.values():
            self._running.callback(program.end)
        self._running.callback(self.programs["service"].end, 10.0)
        for program in self.programs.values():
            program.wanted = True
            program.start()
        keeper = threading.Thread(target=self._keep_running, name="keeper")
        self._clients.append(keeper)
        keeper.start()
        eventually(self._is_up, "the service answers")
        session = self._running.enter_context(open_client([self.settings.zenoh], wait_s=STARTED_WITHIN_S))
        self.session = session
        self.poses = {
            glove: self._running.enter_context(PoseSubscriber(session, SITE, glove)) for glove in GLOVES
        }
        eventually(lambda: all(self.poses[glove].latest for glove in GLOVES), "a pose of each glove")
        self._recording.set()
        for number, work in enumerate((self._write, *(self._recorder_of(glove) for glove in GLOVES))):
            client = threading.Thread(target=work, args=(random.Random(f"{self.seed}/{number}"),))
            self._clients.append(client)
            client.start()

    def _mounted(self, folder: Path) -> bool:
        command = ["mount", "-t", "tmpfs", "-o", f"size={DISK_MB}m", "glovecal-faults", str(folder)]
        if shutil.which("mount") is None or subprocess.run(command, capture_output=True).returncode:
            return False
        self._running.callback(subprocess.run, ["umount", "-l", str(folder)], check=True)
        return True

    def _store_a_model(self) -> None:
        """A plane through made-up samples, so that the left glove's poses have angles."""
        layout = Layout.built_in(LAYOUT)
        time_s = np.arange(200) / 100.0
        readings = np.random.default_rng(0).uniform(100.0, 4000.0, (200, len(layout.sensors)))
        angles = np.repeat(readings.mean(axis=1, keepdims=True) / 50.0, len(layout.rotations), axis=1)
        take = Take("t", "w", layout.sensors, time_s, readings, layout.rotations, time_s, angles)
        model = train([take], layout, SUBJECT, TrainingSettings(method="linear", folds=0))
        with Store.open(self.settings) as store:
            store.subjects.create(SUBJECT)
            record = store.models.add(
                dump(model), subject=SUBJECT, layout=LAYOUT, method="linear", parent=None, facts={}
            )
            store.models.activate(record.id)

    def _programs(self) -> dict[str, Program]:
        """By name; of the service's three parts ``part`` knows."""
        environment = {name: text for name, text in os.environ.items() if not name.startswith("GLOVECAL_")}
        environment |= {
            "GLOVECAL_DATA": str(self.data),
            "GLOVECAL_ZENOH": self.settings.zenoh,
            "GLOVECAL_PORT": str(self.web_port),
        }
        serve = ["-m", "glovecal_service.cli.command", "serve", "--no-studio"]
        commands = {"service": serve} | {f"capture {glove}": self._capture(glove) for glove in GLOVES}
        return {
            name: Program([sys.executable, *command], self.folder / f"{name}.log", environment)
            for name, command in commands.items()
        }

    def _port(self, glove: str) -> Path:
        return self.folder / f"emulated-{glove}"

    def _emulated(self, glove: str, seed: int) -> Emulation:
        protocol = PROTOCOLS[PROTOCOL[glove]]
        hand, port = MovingHand(seed), PseudoTerminal(self._port(glove))
        return Emulation(protocol.make(hand, Faults(), False), port)

    def _capture(self, glove: str) -> list[str]:
        device = PROTOCOLS[PROTOCOL[glove]].device.format(port=self._port(glove))
        return [
            str(HERE / "fault_capture.py"), str(self.clock_file), "--device", device, "--glove", glove,
            "--subject", SUBJECT, "--wearing", "w", "--data", str(self.captured),
            "--connect", f"tcp/127.0.0.1:{self.links[glove].port}",
        ]  # fmt: skip

    def _keep_running(self) -> None:
        """As an operating system's service manager does: what ended is started again."""
        while not self._stopping.wait(0.1):
            for program in self.programs.values():
                if program.wanted and program.process is None:
                    program.start()

    def _is_up(self) -> bool:
        with suppress(httpx.TransportError):
            return httpx.get(f"{self.url}/v1/health/ready", timeout=5.0).status_code == 200
        return False

    def part(self, name: str) -> psutil.Process | None:
        """A process: of ``programs``, or ``real time``, ``recorder`` and ``web``; None while it is not there.

        The recorder is the one that listens on nothing and has a connection to the router.
        """
        if name in self.programs:
            return self.programs[name].process
        service = self.programs["service"].process
        with suppress(psutil.Error):
            for child in service.children() if service is not None else []:
                connections = child.net_connections("tcp")
                ports = {item.laddr.port for item in connections if item.status == psutil.CONN_LISTEN}
                is_client = any(item.raddr and item.raddr.port == self.router_port for item in connections)
                found = {self.router_port: "real time", self.web_port: "web"}
                of = {found[port] for port in ports & set(found)} or ({"recorder"} if is_client else set())
                if name in of:
                    return child
        return None

    def set_clock_by(self, seconds: float) -> None:
        """Of the captures' computer, against the true time."""
        unnamed = self.clock_file.with_suffix(".new")
        unnamed.write_text(repr(seconds))
        unnamed.replace(self.clock_file)

    # The client that writes, and the one that records each glove.

    def _write(self, chance: random.Random) -> None:
        number = 0
        with RestClient(self.url, patience_s=10.0) as client:
            while not self._stopping.wait(chance.uniform(0.05, 0.2)):
                number += 1
                name, title, asked_ns = f"s{number}", f"{chance.random()}", clock_ns()
                try:
                    client.post("/subjects", {"name": name, "title": title})
                except Refused as error:
                    self.writes.refused[error.status] = self.writes.refused.get(error.status, 0) + 1
                except NoService:
                    self.writes.unanswered += 1
                else:
                    self.writes.acknowledged[name] = title
                    self.writes.last_ns = asked_ns

    def _recorder_of(self, glove: str) -> Callable[[random.Random], None]:
        def work(chance: random.Random) -> None:
            with RestClient(self.url, patience_s=10.0) as client:
                number = 0
                while not self._stopping.is_set():
                    number += 1
                    if not self._recording.is_set():
                        self._stopping.wait(0.1)
                        continue
                    asked = self._begun(client, glove, f"{glove}-{number}", chance.choice([0.0, 2.0]))
                    if asked is None:
                        continue
                    until = time.monotonic() + chance.uniform(1.0, 6.0)
                    while time.monotonic() < until and self._recording.is_set():
                        time.sleep(0.05)
                    asked.stop_asked_ns = clock_ns()
                    self._insist(lambda asked=asked: client.post(f"/recordings/{asked.id}/stop"))

        return work

    def _begun(self, client: RestClient, glove: str, name: str, lead_s: float) -> RecordingAsked | None:
        """A recording that the service says there is; one that was begun without an answer is found."""
        body = {"glove": glove, "name": name, "lead_s": lead_s}
        try:
            id = client.post("/recordings", body)["id"]
        except (ClientError, OSError):
            self._stopping.wait(0.2)
            with suppress(ClientError, OSError):
                for document in client.get("/recordings", {"glove": glove, "only_open": "true"}):
                    if document["state"] in ("requested", "recording"):
                        self.recordings.append(RecordingAsked(document["id"], glove))
                        return self.recordings[-1]
            return None
        self.recordings.append(RecordingAsked(id, glove))
        return self.recordings[-1]

    def _insist(self, ask: Callable[[], object]) -> None:
        while not self._stopping.is_set():
            try:
                ask()
                return
            except Refused as error:
                if error.status == 404:
                    self.told.append(f"a recording that was acknowledged is not there: {error}")
                    return
            except NoService:
                pass
            self._stopping.wait(0.1)

    def stop_recording(self) -> None:
        """No recording is begun any more, and those that go on are stopped."""
        self._recording.clear()

    def broken(self, since_ns: int) -> list[str]:
        """What does not work again: a pose of each glove and an acknowledged write, all from after
        ``since_ns``, and the parts of the service."""
        poses = {glove: subscriber.latest for glove, subscriber in self.poses.items()}
        silent = [
            f"no pose of {glove}"
            for glove, pose in poses.items()
            if pose is None or pose.stale or pose.monotonic_ns <= since_ns
        ]
        lost = [] if self.writes.last_ns > since_ns else ["no write is acknowledged"]
        return silent + lost + [f"no {part}" for part in ("recorder", "real time") if self.part(part) is None]


@contextmanager
def suspended(process: psutil.Process | None) -> Iterator[None]:
    """SIGSTOP, then SIGCONT; of a process that is gone meanwhile nothing."""
    with suppress(psutil.Error):
        if process is not None:
            process.suspend()
    try:
        yield
    finally:
        with suppress(psutil.Error):
            if process is not None:
                process.resume()
