"""While the object store or the database is killed, hung or full: every route answers within 5 s with a
sentence, no pose is missing, and afterwards everything is as before, without a restart."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from away_support import ServedSite, in_order, served_site
from postgres_server import PostgresServer
from realtime_support import eventually
from s3_server import BUCKET, S3Server

from glovecal_client.rest import Refused, RestClient
from glovecal_service.settings import Settings

pytestmark = pytest.mark.needs_postgres
FEW = (
    *("GET /v1/subjects", "GET /v1/takes/{id}/series", "GET /v1/models/{id}/export", "GET /v1/overview"),
    *("POST /v1/takes", "POST /v1/models/import", "POST /v1/models/{id}/activate", "GET /v1/health/ready"),
    *("POST /v1/models/{id}/predict", "GET /v1/jobs/{id}/events", "PUT /v1/takes/{id}/note"),
)
"""A route of each kind: of rows, of artifacts, of both, written and read."""


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
def away(server: S3Server | PostgresServer | Path, how: str) -> Iterator[None]:
    """``server``: or its disk."""
    if isinstance(server, Path):
        with filled(server):
            yield
        return
    if isinstance(server, S3Server):
        match how:
            case "killed":
                server.kill()
                yield
                server.start()
            case _:
                server.halt()
                yield
                server.go_on()
        return
    if how == "killed":
        os.kill(int((server.folder / "data" / "postmaster.pid").read_text().split()[0]), signal.SIGKILL)
        yield
        server.start_after_kill()
    else:
        with server.hanging():
            yield


def try_it(
    site: ServedSite, server: S3Server | PostgresServer | Path, how: str, only: tuple[str, ...] = ()
) -> None:
    asked = [each for each in in_order() if not only or str(each) in only]
    before = site.states(asked)
    with away(server, how):
        complaints = site.complaints(asked, site.doomed, 503, 507)
        if server == site.objects.folder:
            eventually(lambda: "not sent yet" in site.http.get("/health/ready").text, "what waits is told")
    eventually(lambda: site.http.get("/health/ready").is_success, "it is ready again")
    eventually(lambda: "not sent yet" not in site.http.get("/health/ready").text, "nothing waits")
    assert not complaints, "\n".join(complaints)
    assert site.states(asked) == before
    assert not (more := site.complaints(asked, site.kept)), "\n".join(more)
    print(f"{how}: the slowest answer of {len(asked)} after {site.slowest_s:.1f} s,", end=" ")
    print(f"{len(site.poses.missing)} of {site.poses.sent} frames without a pose")
    assert len(missing := site.poses.missing) <= site.poses.skipped <= site.poses.sent / 100, missing
    assert site.failures() == []


@pytest.mark.slow  # half a minute each
@pytest.mark.parametrize("how", ["killed", "hung", "full"])
def test_every_route_while_the_object_store_is(
    how: str, postgres: PostgresServer, small: Path, tmp_path: Path
) -> None:
    objects = S3Server(small)
    try:
        with served_site(tmp_path, objects, postgres.new_database()) as site:
            try_it(site, small if how == "full" else objects, how)
    finally:
        objects.kill()


@pytest.mark.slow  # half a minute each
@pytest.mark.parametrize("how", ["killed", "hung", "full"])
def test_every_route_while_the_database_is(
    how: str,
    own_postgres: PostgresServer,
    s3_server: S3Server,
    tmp_path: Path,
    mount_small_disk: Callable[[Path, str], None],
) -> None:
    disk = own_postgres.folder / "small"  # where its user may go
    disk.mkdir()
    mount_small_disk(disk, "40m")
    with served_site(tmp_path, s3_server, own_postgres.new_database(place=disk)) as site:
        try_it(site, disk if how == "full" else own_postgres, how)


def test_a_route_of_each_kind_while_a_store_hangs(
    own_postgres: PostgresServer, s3_server: S3Server, tmp_path: Path
) -> None:
    with served_site(tmp_path, s3_server, own_postgres.new_database()) as site:
        try_it(site, s3_server, "hung", FEW)
        try_it(site, own_postgres, "hung", FEW)


def test_a_table_that_was_sent_to_one_service_is_imported_at_the_other(
    serve: Callable[..., str], s3_server: S3Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in s3_server.environment.items():
        monkeypatch.setenv(name, value)
    shared = {"database": f"sqlite:///{tmp_path / 'one.sqlite3'}", "artifacts": f"s3://{BUCKET}/site"}
    here, there = (Settings.model_validate({"data": tmp_path / name, **shared}) for name in ("a", "b"))
    with RestClient(serve(here)) as first, RestClient(serve(there)) as second:
        first.post("/subjects", {"name": "anna"})
        table = "".join(f"{frame / 60},t,{frame % 90},{frame % 90 * 0.5}\n" for frame in range(300))
        content = f"time_s,take,s.I_MCP,r.I_MCP\n{table}".encode()
        (tmp_path / "t.csv").write_bytes(content)
        sha256 = first.upload(tmp_path / "t.csv")
        wanted = {"upload": sha256, "filename": "t.csv", "subject": "anna"}

        def imported() -> bool:
            with suppress(Refused):
                return bool(second.post("/takes/import", wanted))
            return False

        eventually(imported, "the other service has the file")
        assert [take["name"] for take in first.get("/takes")] == ["t"]
