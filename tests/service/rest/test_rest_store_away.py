"""While the object store or the database is killed, hung or full: every route answers within 5 s with a
sentence, no pose is missing, and afterwards everything is as before, without a restart."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from away_support import ServedSite, in_order, processes_of, served_site
from postgres_server import PostgresServer, find_programs
from realtime_support import eventually
from s3_server import S3Server

pytestmark = pytest.mark.needs_postgres
MESSAGES = {"killed": 503, "hung": 503, "full": 507}
FEW = (
    *("GET /v1/subjects", "GET /v1/takes/{id}/series", "GET /v1/models/{id}/export", "GET /v1/overview"),
    *("POST /v1/takes", "POST /v1/models/import", "POST /v1/models/{id}/activate", "GET /v1/health/ready"),
    *("POST /v1/models/{id}/predict", "GET /v1/jobs/{id}/events", "PUT /v1/takes/{id}/note"),
)
"""A route of each kind: of rows, of artifacts, of both, written and read."""


@pytest.fixture
def own_postgres(postgres: PostgresServer) -> Iterator[PostgresServer]:
    """A server of this test alone."""
    programs = find_programs()
    assert programs is not None
    server = PostgresServer(programs)
    yield server
    server.remove()


@pytest.fixture
def small(tmp_path: Path, mount_small_disk: Callable[[Path, str], None]) -> Path:
    folder = tmp_path / "small"
    folder.mkdir()
    mount_small_disk(folder, "24m")
    return folder


@contextmanager
def filled(folder: Path) -> Iterator[None]:
    """To its last byte."""
    filler = folder / "filler"
    with suppress(OSError), filler.open("wb", buffering=0) as file:
        while True:
            file.write(bytes(1 << 16))
    with suppress(OSError), filler.open("ab", buffering=0) as file:
        while True:
            file.write(b"\0")
    try:
        yield
    finally:
        filler.unlink()


@contextmanager
def away(server: S3Server | PostgresServer, how: str) -> Iterator[None]:
    if isinstance(server, S3Server):
        match how:
            case "killed":
                server.kill()
                yield
                server.start()
            case "hung":
                server.halt()
                yield
                server.go_on()
            case _:
                with filled(server.folder):
                    yield
        return
    processes = processes_of(server)
    if how == "killed":
        os.kill(processes[-1], signal.SIGKILL)
        yield
        server.start_after_kill()
    elif how == "hung":
        for process in processes:
            os.kill(process, signal.SIGSTOP)
        yield
        for process in processes[::-1]:
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGCONT)


def try_it(site: ServedSite, server: S3Server | PostgresServer, how: str, only: tuple[str, ...] = ()) -> None:
    asked = [each for each in in_order() if not only or str(each) in only]
    before = site.states()
    with away(server, how):
        complaints = site.complaints(asked, site.doomed, 503, 507)
    eventually(lambda: site.http.get("/health/ready").is_success, "it is ready again")
    assert not complaints, "\n".join(complaints)
    assert site.states() == before
    assert not (more := site.complaints(asked, site.kept)), "\n".join(more)
    assert site.poses.missing == []
    assert "Traceback" not in site.log.read_text()


@pytest.mark.slow  # a minute each
@pytest.mark.parametrize("how", ["killed", "hung", "full"])
def test_every_route_while_the_object_store_is(
    how: str, postgres: PostgresServer, small: Path, tmp_path: Path
) -> None:
    objects = S3Server(small)
    try:
        with served_site(tmp_path, objects, postgres.new_database()) as site:
            try_it(site, objects, how)
    finally:
        objects.kill()


@pytest.mark.slow  # a minute each
@pytest.mark.parametrize("how", ["killed", "hung"])
def test_every_route_while_the_database_is(how: str, own_postgres: PostgresServer, tmp_path: Path) -> None:
    objects = S3Server(tmp_path / "objects")
    try:
        with served_site(tmp_path, objects, own_postgres.new_database()) as site:
            try_it(site, own_postgres, how)
    finally:
        objects.kill()
