"""Stores to test with: SQLite always, PostgreSQL where it is installed."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import NoReturn

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from jobs_counting import CountingJob
from postgres_server import PostgresServer, find_programs
from s3_server import S3Server

from glovecal_service.jobs.dispatcher import Dispatcher
from glovecal_service.questions.catalogue import ANSWERED
from glovecal_service.settings import Settings
from glovecal_service.store import Store


@pytest.fixture
def mount_small_disk(not_here: Callable[[str], NoReturn]) -> Iterator[Callable[[Path, str], None]]:
    """Mounts a tmpfs of a size such as ``3m`` on a folder, until the end of the test."""
    with ExitStack() as mounted:

        def mount(folder: Path, size: str) -> None:
            command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "glovecal-test", str(folder)]
            if shutil.which("mount") is None or subprocess.run(command, capture_output=True).returncode:
                not_here("a small disk cannot be mounted here (run the tests as root on Linux)")
            mounted.callback(subprocess.run, ["umount", "-l", str(folder)], check=True)

        yield mount


@pytest.fixture(scope="session")
def postgres(not_here: Callable[[str], NoReturn]) -> Iterator[PostgresServer]:
    """A running PostgreSQL; without one the test is skipped, or fails if everything is required."""
    programs = find_programs()
    if programs is None:
        not_here("PostgreSQL's initdb and pg_ctl are not installed (Debian: apt-get install postgresql)")
    server = PostgresServer(programs)
    yield server
    server.remove()


@pytest.fixture
def own_postgres(postgres: PostgresServer) -> Iterator[PostgresServer]:
    """A server of one test alone: it will be killed."""
    server = PostgresServer(postgres.programs)
    yield server
    server.remove()


@pytest.fixture
def s3_server(tmp_path: Path) -> Iterator[S3Server]:
    """A running object store of this test alone."""
    server = S3Server(tmp_path / "objects")
    yield server
    server.kill()


@pytest.fixture
def sqlite_settings(tmp_path: Path) -> Settings:
    return Settings(data=tmp_path / "data", database=None, artifacts=None, workers=2)


@pytest.fixture(params=["sqlite", pytest.param("postgresql", marks=pytest.mark.needs_postgres)])
def store_settings(request: pytest.FixtureRequest, sqlite_settings: Settings) -> Settings:
    """Settings of an empty store on each of the two databases."""
    if request.param == "sqlite":
        return sqlite_settings
    server = request.getfixturevalue("postgres")
    return sqlite_settings.model_copy(update={"database": server.new_database()})


@pytest.fixture
def store(store_settings: Settings) -> Iterator[Store]:
    with Store.open(store_settings) as store:
        yield store


@pytest.fixture
def sqlite_store(sqlite_settings: Settings) -> Iterator[Store]:
    with Store.open(sqlite_settings) as store:
        yield store


@pytest.fixture(scope="session")
def dispatched(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Store, Dispatcher]]:
    """A store whose jobs are run, by one pair of worker processes for all tests."""
    settings = Settings(data=tmp_path_factory.mktemp("dispatched"), database=None, artifacts=None, workers=2)
    kinds = {**ANSWERED, "count": CountingJob()}
    with Store.open(settings) as store, Dispatcher(store, settings, lambda: kinds) as dispatcher:
        yield store, dispatcher
