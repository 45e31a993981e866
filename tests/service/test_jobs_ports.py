"""The ports of the training processes: nobody without the key of this start runs anything through them."""

from __future__ import annotations

import os
from pathlib import Path

import distributed
import psutil
import pytest
from distributed import LocalCluster
from jobs_counting import CountingJob
from jobs_waiting import result_of, wait_for
from port_attack import NOBODY, attack

from glovecal_service.jobs.dispatcher import Dispatcher


def listening() -> set[int]:
    """TCP ports of this process and its children."""
    me = psutil.Process()
    connections = [item for process in (me, *me.children(recursive=True)) for item in _connections(process)]
    return {item.laddr.port for item in connections if item.status == psutil.CONN_LISTEN}


def _connections(process):
    try:
        return process.net_connections("tcp")
    except psutil.Error:  # it is gone or, as nobody's files, refused while it goes
        return []


def create(store, ledger, numbers):
    return store.jobs.create("count", {"numbers": numbers, "seconds": 0.0, "ledger": str(ledger)}).id


@pytest.fixture
def another_user(not_here):
    if os.getuid() != 0:
        not_here("becoming another user needs root (run the tests as root)")
    packages = Path(distributed.__file__).parent
    if not all(folder.stat().st_mode & 0o001 for folder in (packages, *packages.parents)):
        not_here(f"another user cannot read {packages} (clone to a folder that others can read)")
    return NOBODY


def test_another_user_runs_nothing(sqlite_store, sqlite_settings, tmp_path, another_user):
    before = listening()
    with Dispatcher(sqlite_store, sqlite_settings, lambda: {"count": CountingJob()}) as dispatcher:
        assert result_of(sqlite_store, create(sqlite_store, tmp_path / "ledger", [1, 2]))["sums"] == [1, 3]
        ports = listening() - before
        open_to_all = LocalCluster(
            n_workers=0, processes=False, protocol="tcp://", host="127.0.0.1", dashboard_address="127.0.0.1:0"
        )
        try:
            port = int(open_to_all.scheduler_address.rpartition(":")[2])
            run = attack([*ports, port])
        finally:
            open_to_all.close()
        assert run == {f"{port}-raw-tcp-{os.getuid()}"}, "only where nothing protects, and there it works"
        assert str(dispatcher.workers.address).startswith("tls://127.0.0.1:")
        assert len(ports) == 5, "of one scheduler, two workers and their nannies, and no web server"
        assert result_of(sqlite_store, create(sqlite_store, tmp_path / "ledger", [3]))["sums"] == [6]


def test_the_ports_close_when_nobody_needs_them(sqlite_store, sqlite_settings, tmp_path):
    before = listening()
    settings = sqlite_settings.model_copy(update={"workers_idle_s": 0.5})
    with Dispatcher(sqlite_store, settings, lambda: {"count": CountingJob()}) as dispatcher:
        for number in (3, 4):
            result_of(sqlite_store, create(sqlite_store, tmp_path / "ledger", [number]))
            wait_for(lambda: not dispatcher.workers.started)
            wait_for(lambda: listening() <= before)
