"""Workers on other computers, as far as one computer shows: they share no folder, and come with certificates.

Each worker is the command that users start. The service is a dispatcher that trains nothing itself.
"""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import psutil
import pytest
from free_ports import free_port
from jobs_counting import CountingJob, noted
from jobs_waiting import result_of, wait_for, wait_for_job
from port_attack import attack

import glovecal_models
from glovecal_client.site.certificates import client_context
from glovecal_client.site.member import Kind, Member
from glovecal_service.jobs.code_identity import code_identity
from glovecal_service.jobs.dispatcher import Dispatcher
from glovecal_service.settings import Settings
from glovecal_service.store import Store
from glovecal_service.store.records import JobRecord
from glovecal_service.store.site.site_folder import SiteFolder

TESTS = Path(__file__).parents[1]
TOLD_WITHIN_S = 10.0


class Worker:
    """``glovecal worker`` with a member's file, in a folder of its own, and what its terminal shows."""

    def __init__(self, place: Path, member: Member, *, processes: int = 1, code: Path | None = None) -> None:
        place.mkdir()
        file = place / "member.glovecal"
        file.write_text(member.document())
        known = {name: value for name, value in os.environ.items() if not name.startswith("GLOVECAL_")}
        path = os.pathsep.join(str(each) for each in (code, TESTS) if each is not None)
        self.lines: list[str] = []
        self.began = time.monotonic()
        self.process = subprocess.Popen(
            [Path(sys.executable).parent / "glovecal", "worker", "--processes", str(processes)],
            env=known | {"GLOVECAL_SITE_FILE": str(file), "PYTHONPATH": path, "HOME": str(place)}, cwd=place,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip
        self._reading = threading.Thread(target=self._read, daemon=True)
        self._reading.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        with self.process.stdout as lines:
            for line in lines:
                self.lines.append(line.strip())

    def shows(self, words: str, within_s: float = 300.0) -> str:
        wait_for(lambda: any(words in line for line in self.lines) or self._has_ended(), within_s)
        found = [line for line in self.lines if words in line]
        assert found, self.lines
        return found[-1]

    def _has_ended(self) -> bool:
        if self.process.poll() is None:
            return False
        self._reading.join()
        return True

    def training_processes(self) -> list[psutil.Process]:
        return psutil.Process(self.process.pid).children()

    def stop(self) -> None:
        self.process.terminate()
        try:
            self.process.wait(30)
        finally:
            self.process.kill()
            self._reading.join()


class Service:
    """A store and a dispatcher without workers of its own, at a site on loopback."""

    def __init__(self, place: Path, port: int, workers_idle_s: float = 60.0) -> None:
        self.place, self.port = place, port
        place.mkdir(mode=0o700)
        self.folder = SiteFolder(place, port)
        self.folder.begin("lab", [], zenoh_port=7447, rest_port=8600)
        self.settings = Settings(
            data=place, database=None, artifacts=None, workers=0, site_file=self.folder.service_file,
            worker_port=port, host="127.0.0.1", workers_idle_s=workers_idle_s,
        )  # fmt: skip
        self.store = Store.open(self.settings)
        self.dispatcher = Dispatcher(self.store, self.settings, lambda: {"count": CountingJob()})
        self.dispatcher.start()

    def count(self, ledger: Path, *numbers: int, seconds: float = 0.0) -> JobRecord:
        return self.store.jobs.create(
            "count", {"numbers": numbers, "seconds": seconds, "ledger": str(ledger)}
        )

    def stop(self) -> None:
        self.dispatcher.stop()
        self.store.close()


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    service = Service(tmp_path_factory.mktemp("service") / "data", free_port())
    yield service
    service.stop()


@pytest.fixture
def start(service: Service, tmp_path: Path) -> Iterator[Callable[..., Worker]]:
    """Starts a worker as a new member of that name."""
    started: list[Worker] = []

    def begin(name: str, **more) -> Worker:
        worker = Worker(tmp_path / name, service.folder.add(name, "worker"), **more)
        started.append(worker)
        return worker

    yield begin
    for worker in started:
        worker.stop()
    entrance = service.dispatcher._entrance
    assert entrance is not None
    wait_for(lambda: not entrance.has_guests)


def test_a_worker_without_the_data_folder_trains(service: Service, start, tmp_path: Path) -> None:
    ledger = tmp_path / "ledger"
    job = service.count(ledger, 3, 4, 5, seconds=0.3)
    nobody = "waiting for a worker: none is connected, and GLOVECAL_WORKERS=0 leaves training to others"
    wait_for(lambda: service.store.jobs.get(job.id).sentence.startswith(nobody), TOLD_WITHIN_S)
    worker = start("first", processes=2)
    result = result_of(service.store, job.id)
    assert result["sums"] == [6, 10, 15]
    assert {facts["niceness"] for facts in result["facts"]} == {10}
    assert {facts["blas_threads"] for facts in result["facts"]} == {1}
    sentences = [event.sentence for event in service.store.jobs.events(job.id)]
    assert "a worker is there: training" in sentences
    assert any(sentence.startswith("adding up to") for sentence in sentences), "progress, while it trains"
    assert worker.shows("first works for the service at 127.0.0.1").endswith("Ctrl-C stops it.")
    pids = {facts["pid"] for facts in result["facts"]}
    assert pids <= {process.pid for process in worker.training_processes()}
    for process in worker.training_processes():
        assert not [file for file in process.open_files() if Path(file.path).is_relative_to(service.place)]
        assert {each.laddr.ip for each in process.net_connections("tcp")} == {"127.0.0.1"}


def test_a_cancel_reaches_it(service: Service, start, tmp_path: Path) -> None:
    start("canceller")
    ledger = tmp_path / "ledger"
    job = service.count(ledger, 1, 2, seconds=600)
    wait_for(lambda: noted(ledger, "begin"))
    service.store.jobs.request_cancel(job.id)
    assert wait_for_job(service.store, job.id).state == "cancelled"
    assert result_of(service.store, service.count(ledger, 10).id)["sums"] == [55]
    assert noted(ledger, "done") == [10]


def test_a_worker_killed_in_the_middle_is_replaced_and_its_fit_repeated(
    service: Service, start, tmp_path: Path
) -> None:
    ledger = tmp_path / "ledger"
    workers = [start("left"), start("right")]
    for worker in workers:
        worker.shows("works for the service")
    job = service.count(ledger, 1, 2, seconds=1.0)
    wait_for(lambda: len(noted(ledger, "begin")) >= 2)
    [victim] = workers[0].training_processes()
    victim.kill()
    result = result_of(service.store, job.id)
    assert result["sums"] == [1, 3]
    assert victim.pid not in {facts["pid"] for facts in result["facts"]}
    assert workers[0].shows("A training process was killed by signal 9; starting another.")
    job = service.count(ledger, 3, 4, seconds=1.0)
    wait_for(lambda: len(noted(ledger, "begin")) >= 5)
    children = workers[1].training_processes()
    workers[1].process.kill()
    assert result_of(service.store, job.id)["sums"] == [6, 10]
    psutil.wait_procs(children, 30)
    assert not any(child.is_running() for child in children), "they end with the command that began them"


def test_one_with_other_code_is_refused_on_both_sides(service: Service, start, tmp_path: Path) -> None:
    other = tmp_path / "other"
    shutil.copytree(Path(glovecal_models.__file__).parent, other / "glovecal_models")
    changed = other / "glovecal_models" / "calibration" / "training.py"
    changed.write_text(changed.read_text() + "\n# another version\n")
    ledger = tmp_path / "ledger"
    job = service.count(ledger, 3)
    worker = start("older", code=other)
    refusal = worker.shows("older has other code than the service", TOLD_WITHIN_S + 10)
    assert f"source {code_identity()['source']} at the service and " in refusal
    assert f"Install glovecal {code_identity()['glovecal']} and these packages there" in refusal
    assert worker.process.wait(30) != 0
    wait_for(lambda: "the last was refused: older has other code" in service.store.jobs.get(job.id).sentence)
    assert not noted(ledger, "begin"), "it got no task"
    start("newer")
    assert result_of(service.store, job.id)["sums"] == [6]


def test_a_revoked_worker_is_shut_out_in_the_middle(service: Service, start, tmp_path: Path) -> None:
    ledger = tmp_path / "ledger"
    worker = start("leaver")
    job = service.count(ledger, 4, seconds=2.0)
    wait_for(lambda: noted(ledger, "begin"))
    scheduler = service.dispatcher.workers.address
    service.folder.revoke("leaver")
    worker.shows("was revoked, or has expired; make one at the service", TOLD_WITHIN_S)
    assert worker.process.wait(30) != 0
    assert not noted(ledger, "done")
    start("stayer")
    assert result_of(service.store, job.id)["sums"] == [10]
    assert service.dispatcher.workers.address != scheduler, "the keys that it was given open nothing"


async def _greeted(member: Member, port: int) -> bytes:
    """Whatever comes from the entrance to somebody who says the right words."""
    opening = asyncio.open_connection(
        "127.0.0.1", port, ssl=client_context(member), server_hostname="127.0.0.1"
    )
    reader, writer = await opening
    try:
        for wants in ("work", "scheduler"):
            writer.write(
                json.dumps({"code": dict(code_identity()), "wants": wants, "guest": ""}).encode() + b"\n"
            )
        return await asyncio.wait_for(reader.read(), TOLD_WITHIN_S)
    finally:
        writer.close()


@pytest.mark.parametrize("kind", ["viewer", "capture", "service"])
def test_others_of_the_site_do_not_come_in(service: Service, start, kind: Kind) -> None:
    """However hard they try: their certificates are good, and of the same authority."""
    start(f"beside-{kind}").shows("works for the service")
    member = service.folder.add(f"curious-{kind}", kind)
    answer = json.loads(asyncio.run(_greeted(member, service.port)))
    assert answer == {
        "refused": f"the file of this computer is that of a {kind}, which may not train; make one at the "
        "service: glovecal site add NAME --as worker"
    }
    given = {
        "tls_ca_file": member.authority,
        "tls_client_cert": member.certificate,
        "tls_client_key": member.private_key,
    }
    scheduler = int(str(service.dispatcher.workers.address).rpartition(":")[2])
    assert attack([service.port, scheduler], given) == set()


def test_a_file_of_another_kind_is_told_at_once(service: Service, tmp_path: Path) -> None:
    worker = Worker(tmp_path / "viewer", service.folder.add("looker", "viewer"))
    try:
        worker.shows("is the file of a viewer; a worker needs one of its own", TOLD_WITHIN_S + 10)
        assert worker.process.wait(30) == 1
    finally:
        worker.stop()


def test_a_worker_of_another_site_is_told_why(service: Service, start, tmp_path: Path) -> None:
    start("of-this-site").shows("works for the service")
    elsewhere = SiteFolder(tmp_path / "elsewhere", service.port)
    (tmp_path / "elsewhere").mkdir()
    elsewhere.begin("lab", [], zenoh_port=7447, rest_port=8600)
    stranger = Worker(tmp_path / "stranger", elsewhere.add("stranger", "worker"))
    try:
        stranger.shows("belongs to another site than this computer's file", TOLD_WITHIN_S + 10)
    finally:
        stranger.stop()


def test_a_worker_comes_although_nothing_was_to_do_for_long(tmp_path: Path) -> None:
    """The scheduler is not ended as idle before the worker's processes are there; it is when they went."""
    service = Service(tmp_path / "data", free_port(), workers_idle_s=0.01)
    worker = Worker(tmp_path / "late", service.folder.add("late", "worker"))
    try:
        worker.shows("late works for the service", 60)
        assert result_of(service.store, service.count(tmp_path / "ledger", 3).id)["sums"] == [6]
        assert not [line for line in worker.lines if "went away" in line]
        worker.stop()
        wait_for(lambda: not service.dispatcher.workers.started)
    finally:
        worker.stop()
        service.stop()


def test_where_no_service_is_that_is_told(service: Service, tmp_path: Path) -> None:
    member = replace(service.folder.add("early", "worker"), training=f"tls/127.0.0.1:{free_port()}")
    worker = Worker(tmp_path / "early", member)
    try:
        worker.shows("No service lets workers in at 127.0.0.1", TOLD_WITHIN_S + 10)
        assert worker.process.poll() is None, "it tries again"
    finally:
        worker.stop()
