"""Two services of a site with one database, each with its own data folder: one take of a recording, whoever
dies, and no frame lost."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from multiprocessing.process import BaseProcess
from pathlib import Path

import pytest
from realtime_support import LAYOUT, SteadyDevice, Work, eventually, free_endpoint, part_of_service
from recorder_support import GLOVE, capturing, goes_on, patient_recorder, quick_recorder, store_with_glove

from glovecal_client import Recording
from glovecal_service.serve import real_time
from glovecal_service.settings import Settings
from glovecal_service.store import Store
from glovecal_service.store.errors import TakenOver
from glovecal_service.store.recordings import KEEPER


@dataclass
class Service:
    """Of two; ``process`` is its recorder."""

    settings: Settings
    recorder: Work = quick_recorder
    process: BaseProcess | None = None
    opened: ExitStack | None = None

    def start(self) -> None:
        self.opened = ExitStack()
        self.process = self.opened.enter_context(part_of_service(self.recorder, self.settings))

    def end(self) -> None:
        if self.opened is not None and self.process is not None:
            self.process.kill()
            self.opened.close()
            self.opened = None

    def send(self, signal_number: int) -> None:
        assert self.process is not None
        assert self.process.pid is not None
        os.kill(self.process.pid, signal_number)


@contextmanager
def two_services(tmp_path: Path, recorder: Work = quick_recorder) -> Iterator[tuple[Store, list[Service]]]:
    """With a glove that is captured; recorders are to be started. The routers are processes of their own, so
    that a recorder can be killed alone."""
    endpoints = [free_endpoint(), free_endpoint()]
    services = [
        Service(
            Settings(
                data=tmp_path / f"data{number}", database=f"sqlite:///{tmp_path / 'shared.sqlite3'}",
                artifacts=None, zenoh=endpoints[number], zenoh_peers=endpoints[1 - number], site="lab",
            ),
            recorder,
        )
        for number in range(2)
    ]  # fmt: skip
    with store_with_glove(services[0].settings) as store, ExitStack() as running:
        for service in services:
            running.enter_context(part_of_service(real_time, service.settings))
        running.enter_context(capturing(services[0].settings))
        for service in services:
            service.start()
            running.callback(service.end)
        yield store, services


def keeper_of(store: Store, id: str, services: list[Service]) -> Service:
    """Whose recorder has the recording, once it has begun."""

    def found() -> Service | None:
        keeper = str(store.recordings.get(id).facts.get(KEEPER))
        folders = {f":{each.settings.recordings_folder.resolve()}": each for each in services}
        return next((each for folder, each in folders.items() if keeper.endswith(folder)), None)

    return eventually(found, "a recorder has it")


def finished(store: Store, id: str):
    return eventually(
        lambda: found if (found := store.recordings.get(id)).state in ("done", "failed") else None,
        "the recording is done",
    )


def check_take(store: Store, id: str) -> None:
    """One take, with every frame from the recording's begin to its end."""
    record = finished(store, id)
    assert record.state == "done", record.facts.get("sentence")
    facts = record.facts
    assert facts["missing_frames"] == facts["pending_frames"] == 0, facts.get("sentence")
    assert facts["sent"] == facts["recorded"] > 0
    takes = [take for take in store.takes.list() if take.recording == id]
    assert [take.id for take in takes] == [facts["take"]]
    first, last = facts["first_sequence"], facts["last_sequence"]
    assert facts["sent"] == last - first + 1


def test_two_recorders_make_one_take_and_the_other_goes_on_when_one_is_gone_for_good(tmp_path: Path) -> None:
    with two_services(tmp_path) as (store, services):
        plain = store.recordings.request(GLOVE, name="plain", lead_s=0.0)
        keeper_of(store, plain.id, services)
        goes_on(services[0].settings, 100)
        store.recordings.stop(plain.id)
        check_take(store, plain.id)
        moved = store.recordings.request(GLOVE, name="moved", lead_s=0.0)
        first = keeper_of(store, moved.id, services)
        goes_on(services[0].settings, 100)
        first.end()
        other = services[1 - services.index(first)]
        eventually(lambda: keeper_of(store, moved.id, services) is other, "the other goes on")
        goes_on(services[0].settings, 100)
        store.recordings.stop(moved.id)
        check_take(store, moved.id)
        assert store.recordings.get(moved.id).facts["sent"] >= 200, "from its begin on"


def test_a_recorder_that_comes_back_keeps_what_it_began(tmp_path: Path) -> None:
    with two_services(tmp_path, patient_recorder) as (store, services):
        record = store.recordings.request(GLOVE, name="walk", lead_s=0.0)
        first = keeper_of(store, record.id, services)
        for _ in range(2):
            goes_on(services[0].settings, 50)
            first.end()
            first.start()
            assert keeper_of(store, record.id, services) is first
        store.recordings.stop(record.id)
        check_take(store, record.id)


def test_a_recorder_that_stood_still_lets_go_what_another_took_over(tmp_path: Path) -> None:
    with two_services(tmp_path) as (store, services):
        record = store.recordings.request(GLOVE, name="walk", lead_s=0.0)
        first = keeper_of(store, record.id, services)
        goes_on(services[0].settings, 100)
        first.send(signal.SIGSTOP)
        other = services[1 - services.index(first)]
        eventually(lambda: keeper_of(store, record.id, services) is other, "the other goes on")
        first.send(signal.SIGCONT)
        goes_on(services[0].settings, 100)
        store.recordings.stop(record.id)
        check_take(store, record.id)
        ledger = first.settings.recordings_folder / f"{record.id}.glog"
        assert list(Recording.open(ledger).payloads()), "what it had written stays"


@pytest.mark.slow
def test_thirty_two_gloves_and_twenty_kills_cost_no_frame(tmp_path: Path) -> None:
    """Recorders are killed in turn while all gloves are recorded, and started again."""
    more = [f"more{number}" for number in range(31)]
    with two_services(tmp_path) as (store, services), ExitStack() as running:
        for glove in more:
            store.gloves.seen(glove, {"layout": LAYOUT.name, "subject": "anna", "wearing": "morning"})
            device = SteadyDevice(50.0)
            running.enter_context(capturing(services[0].settings, device=device, glove=glove))
        goes_on(services[0].settings, 200)
        ids = [store.recordings.request(glove, name=glove, lead_s=0.0).id for glove in (GLOVE, *more)]
        kept_by = [keeper_of(store, id, services) for id in ids]
        assert {services.index(each) for each in kept_by} == {0, 1}, "both record some"
        for kill in range(20):
            services[kill % 2].end()
            goes_on(services[0].settings, 200)
            services[kill % 2].start()
            goes_on(services[0].settings, 200)
        for id in ids:
            store.recordings.stop(id)
        for id in ids:
            check_take(store, id)
        assert len(store.takes.list()) == len(ids)


def test_only_the_keeper_reports_and_a_recording_has_one_take(tmp_path: Path) -> None:
    settings = Settings(data=tmp_path, database=None, artifacts=None, zenoh=free_endpoint(), site="lab")
    with store_with_glove(settings) as store:
        id = store.recordings.request(GLOVE, name="walk").id
        assert store.recordings.update(id, keeper="one:/data", state="recording").facts[KEEPER] == "one:/data"
        with pytest.raises(TakenOver, match=r"'walk' goes on at one:/data"):
            store.recordings.update(id, keeper="two:/data", sentence="mine")
        seen = store.recordings.get(id)
        store.recordings.update(id, keeper="one:/data", sentence="still here")
        with pytest.raises(TakenOver):
            store.recordings.take_over(seen, "two:/data")
        store.recordings.take_over(store.recordings.get(id), "two:/data")
        with pytest.raises(TakenOver):
            store.recordings.update(id, keeper="one:/data", state="done")
        assert store.recordings.get(id).state == "recording"
