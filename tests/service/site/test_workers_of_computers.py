"""Workers as other users on other computers: they share no folder with the service, are killed and cut off.

Each computer is a network namespace without a way out. A minute or two:
``python3 do.py test -m slow tests/service/site/test_workers_of_computers.py``.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import psutil
import pytest
from jobs_waiting import result_of, wait_for
from port_attack import NOBODY
from site_computers import Computers
from stored_takes import LAYOUT, make_take

import glovecal_models
from glovecal_service.settings import Settings
from glovecal_service.store import Store

ADDRESSES = {"service": "192.168.1.20", "worker-1": "192.168.1.51", "worker-2": "192.168.1.52"}
TOLD_WITHIN_S = 10.0


@pytest.fixture
def computers() -> Iterator[Computers]:
    with ExitStack() as undo:
        place = Path(undo.enter_context(tempfile.TemporaryDirectory(prefix="glovecal-computers-")))
        place.chmod(0o755)
        found = Computers(place, ADDRESSES, {"lab.example": ADDRESSES["service"]})
        try:
            found.build(undo)
        except (OSError, subprocess.CalledProcessError) as error:
            pytest.skip(f"no network namespaces can be made here (root on Linux, iproute2): {error}")
        found.folder("service").chmod(0o700)
        yield found


class Terminal:
    """A command on a computer, and what it has written."""

    def __init__(self, computers: Computers, computer: str, line: str, **more: str) -> None:
        self._file = computers.place / f"{computer}-{time.monotonic_ns()}.txt"
        self.process = computers.start(computer, f"{{ {line}; }} > {self._file} 2>&1", **more)

    @property
    def text(self) -> str:
        return self._file.read_text() if self._file.exists() else ""

    def shows(self, words: str, within_s: float = 120.0) -> float:
        """How long that took, in seconds."""
        began = time.monotonic()
        wait_for(lambda: words in self.text or self.process.poll() is not None, within_s)
        assert words in self.text, self.text
        return time.monotonic() - began

    def training_process(self) -> psutil.Process:
        [process] = psutil.Process(self.process.pid).children()
        assert process.uids().effective == NOBODY
        return process

    def stop(self) -> None:
        self.process.terminate()
        self.process.communicate(timeout=120)


@pytest.mark.slow
def test_workers_train_elsewhere_are_killed_cut_off_and_refused(computers: Computers) -> None:
    computers.run("service", "glovecal site init --host lab.example")
    for name in ("worker-1", "worker-2"):
        computers.run("service", f"glovecal site add {name} --as worker")
        shutil.copy2(computers.folder("service") / f"{name}.glovecal", computers.folder(name))
    computers.run("service", "glovecal key add lena --role admin")
    serve = (
        "exec env GLOVECAL_SITE_FILE=glovecal-data/site/service.glovecal GLOVECAL_HOST=0.0.0.0 "
        "GLOVECAL_ZENOH=tls/0.0.0.0:7447 GLOVECAL_WORKERS=0 glovecal serve"
    )
    with ExitStack() as running:
        running.callback(Terminal(computers, "service", serve).stop)
        store = running.enter_context(
            Store.open(Settings(data=computers.folder("service") / "glovecal-data"))
        )
        store.subjects.create("anna")
        store.layouts.put(LAYOUT)
        takes = [
            store.takes.add(make_take(seed), subject="anna", layout=LAYOUT.name, source="import").id
            for seed in range(3)
        ]

        def train(seed: int, iterations: int = 200) -> str:
            body = {
                "takes": takes,
                "method": "spgp",
                "pseudo_inputs": 60,
                "iterations": iterations,
                "seed": seed,
            }
            payload = {"subject": "anna", "layout": LAYOUT.name, **body}
            return store.jobs.create("train", payload, subject="anna").id

        def work(name: str, **more: str) -> Terminal:
            line = computers.as_nobody(
                name, f"env GLOVECAL_SITE_FILE={name}.glovecal glovecal worker --processes 1"
            )
            terminal = Terminal(computers, name, line, **more)
            running.callback(terminal.stop)
            return terminal

        job = train(1)
        wait_for(lambda: store.jobs.get(job).state == "running", 60)
        began = time.monotonic()
        wait_for(
            lambda: "waiting for a worker: none is connected" in store.jobs.get(job).sentence, TOLD_WITHIN_S
        )
        print(f"that nobody works is told after {time.monotonic() - began:.1f} s")
        first = work("worker-1")
        first.shows("works for the service at lab.example:8601")
        assert result_of(store, job)["model"]
        closed = computers.folder("service") / "glovecal-data"
        line = computers.as_nobody("worker-1", f"ls {closed}")
        assert "Permission denied" in computers.start("worker-1", line).communicate(timeout=60)[1]

        second = work("worker-2")
        second.shows("works for the service")
        job = train(2, 2000)
        wait_for(
            lambda: "of 3 fits done" in store.jobs.get(job).sentence or store.jobs.get(job).fraction > 0.05
        )
        first.training_process().kill()
        assert result_of(store, job)["model"]
        first.shows("A training process was killed by signal 9; starting another.")

        job = train(3, 2000)
        wait_for(lambda: store.jobs.get(job).fraction > 0.05)
        computers.plug("worker-1", False)
        took = first.shows("The service at lab.example:8601 went away. Trying again.", TOLD_WITHIN_S)
        print(f"that the service is out of reach is told after {took:.1f} s")
        assert result_of(store, job)["model"], "the other worker does what this one had"
        computers.plug("worker-1", True)

        second.stop()
        other = computers.folder("worker-2") / "other"
        shutil.copytree(Path(glovecal_models.__file__).parent, other / "glovecal_models")
        changed = other / "glovecal_models" / "calibration" / "training.py"
        changed.write_text(changed.read_text() + "\n# another version\n")
        work("worker-2", PYTHONPATH=str(other)).shows("worker-2 has other code than the service")
        wait_for(lambda: first.text.count("works for the service") >= 2, 60)
        assert result_of(store, train(4))["model"], "and the others go on"
