"""PostgreSQL killed under writes: nothing acknowledged is lost, the store goes on by itself afterwards."""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest
from jobs_waiting import wait_for
from realtime_support import free_endpoint
from sqlalchemy import text

from glovecal_models.errors import BadInput
from glovecal_service.jobs.dispatcher import Dispatcher
from glovecal_service.questions.catalogue import ANSWERED
from glovecal_service.store import Store
from glovecal_service.store.database import Database
from glovecal_service.store.errors import StoreUnavailable

pytestmark = pytest.mark.needs_postgres


def test_nothing_acknowledged_is_lost_when_the_server_is_killed(own_postgres, sqlite_settings):
    settings = sqlite_settings.model_copy(update={"database": own_postgres.new_database()})
    with Store.open(settings) as store, Dispatcher(store, settings, lambda: ANSWERED):
        acknowledged, refused, stop = [], [], threading.Event()

        def write() -> None:
            number = 0
            while not stop.is_set():
                number += 1
                try:
                    acknowledged.append(store.subjects.create(f"s{number}").name)
                except StoreUnavailable:
                    refused.append(number)
                    stop.wait(0.05)

        writer = threading.Thread(target=write)
        writer.start()
        wait_for(lambda: len(acknowledged) >= 20)
        postmaster = int((own_postgres.folder / "data" / "postmaster.pid").read_text().split()[0])
        os.kill(postmaster, signal.SIGKILL)
        wait_for(lambda: refused)
        before = len(acknowledged)
        own_postgres.start_after_kill()
        wait_for(lambda: len(acknowledged) >= before + 5)
        stop.set()
        writer.join()
        assert set(acknowledged) <= {record.name for record in store.subjects.list()}
        job = store.jobs.create("knit", {})
        wait_for(lambda: store.jobs.get(job.id).state == "failed")


def test_a_server_that_is_not_there_is_named_without_its_password(tmp_path):
    database = Database(f"postgresql://anna:secret@/x?host={tmp_path}")
    with pytest.raises(StoreUnavailable) as raised, database.read():
        pass
    assert "secret" not in str(raised.value)
    database.close()
    for url in ("mysql://x", "not a url", "sqlite+aiosqlite:///x"):
        with pytest.raises(BadInput, match="GLOVECAL_DATABASE"):
            Database(url)


def test_serve_waits_for_a_server_that_is_still_starting(own_postgres, tmp_path):
    settings = {
        "GLOVECAL_DATA": str(tmp_path / "data"),
        "GLOVECAL_DATABASE": own_postgres.new_database(),
        "GLOVECAL_PORT": free_endpoint().rpartition(":")[2],
        "GLOVECAL_ZENOH": free_endpoint(),
    }
    own_postgres.stop()
    command = [sys.executable, "-m", "glovecal_service.cli.command", "serve", "--no-studio"]
    serving = subprocess.Popen(
        command, env=os.environ | settings, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        assert serving.stderr is not None
        assert serving.stdout is not None
        while "waiting 60 s for the database" not in (line := serving.stderr.readline()):
            assert line, "it ended"
        own_postgres.start()
        assert serving.stdout.readline().startswith("Glovecal is running")
    finally:
        serving.kill()
        serving.communicate()


def test_a_server_that_hangs_is_told_at_once_and_a_long_statement_is_waited_for(
    own_postgres, sqlite_settings
):
    settings = sqlite_settings.model_copy(update={"database": own_postgres.new_database()})
    with Store.open(settings) as store:
        store.subjects.create("anna")
        with store.database.read() as connection:
            assert connection.scalar(text("SELECT 7 FROM pg_sleep(3)")) == 7
        with own_postgres.hanging():
            asked = [threading.Thread(target=refused, args=(store,)) for _ in range(4)]
            for each in asked:
                each.start()
            for each in asked:
                each.join(60)
                assert not each.is_alive(), "it waits for the server that hangs"
        wait_for(lambda: answers(store))
        assert [each.name for each in store.subjects.list()] == ["anna"]


def refused(store: Store) -> None:
    began = time.monotonic()
    with pytest.raises(StoreUnavailable):
        store.subjects.list()
    print(f"told after {time.monotonic() - began:.1f} s")


def answers(store: Store) -> bool:
    try:
        return bool(store.subjects.list())
    except StoreUnavailable:
        return False
