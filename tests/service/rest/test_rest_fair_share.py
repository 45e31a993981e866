"""One key that asks without end: it is told so, and others are answered meanwhile."""

from __future__ import annotations

import socket
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import anyio
import anyio.lowlevel
import httpx
import pytest
from anyio.from_thread import start_blocking_portal

from glovecal_service.rest.app import create_app
from glovecal_service.rest.http import fair_share, server
from glovecal_service.rest.http.fair_share import BURST, MOST_AT_ONCE, MOST_HZ, FairShare
from glovecal_service.rest.http.problem import Problem
from glovecal_service.rest.in_process import PortalTransport
from glovecal_service.settings import Settings
from glovecal_service.store.store import Store


@pytest.fixture
def asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], httpx.Response]]:
    """Ask for the people as the key of that name; each may ask five times, then once in a hundred seconds."""
    monkeypatch.setattr(fair_share, "BURST", 5)
    monkeypatch.setattr(fair_share, "MOST_HZ", 0.01)
    settings = Settings(data=tmp_path / "data", login="always")
    with Store.open(settings) as store:
        keys = {name: store.keys.create(name, "viewer")[1] for name in ("hasty", "calm")}
        app = create_app(settings, store)
        with (
            start_blocking_portal() as portal,
            portal.wrap_async_context_manager(app.router.lifespan_context(app)),
            httpx.Client(transport=PortalTransport(app, portal), base_url="http://localhost/v1") as http,
        ):
            yield lambda name: http.get("/subjects", headers={"Authorization": f"Bearer {keys[name]}"})


def test_one_that_asks_too_often_is_told_when_to_ask_again(asked: Callable[[str], httpx.Response]) -> None:
    assert [asked("hasty").status_code for _ in range(7)] == [200] * 5 + [429] * 2
    refused = asked("hasty")
    assert 0 < int(refused.headers["Retry-After"]) <= 100
    assert refused.json()["detail"].startswith("hasty asks more than ")
    assert asked("calm").status_code == 200


def test_a_burst_is_answered_and_then_so_many_a_second() -> None:
    at_s = 1000.0
    share = FairShare(lambda: at_s)

    async def answered() -> bool:
        try:
            async with share.turn("hasty", "/v1/takes"):
                return True
        except Problem:
            return False

    async def story() -> None:
        nonlocal at_s
        assert sum([await answered() for _ in range(2 * BURST)]) == BURST
        at_s += 2.0
        assert sum([await answered() for _ in range(2 * BURST)]) == 2 * MOST_HZ

    anyio.run(story)


def test_so_many_are_answered_at_once_the_others_wait_and_streams_do_not_count() -> None:
    share, inside, most, leave = FairShare(), 0, 0, anyio.Event()

    async def ask(who: str, path: str) -> None:
        nonlocal inside, most
        async with share.turn(who, path):
            inside, most = inside + 1, max(most, inside + 1)
            await leave.wait()
            inside -= 1

    async def story() -> None:
        async with anyio.create_task_group() as asking:
            for _ in range(3 * MOST_AT_ONCE):
                asking.start_soon(ask, "hasty", "/v1/models/m/compare")
            asking.start_soon(ask, "calm", "/v1/takes")
            asking.start_soon(ask, "hasty", "/v1/jobs/j/events")
            await anyio.wait_all_tasks_blocked()
            assert inside == MOST_AT_ONCE + 2
            leave.set()
        assert (inside, most) == (0, MOST_AT_ONCE + 2)

    anyio.run(story)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere loopback has one address")
def test_one_address_leaves_connections_for_others(
    serve: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Loopback counts as one of many here: it is all that a test has."""
    monkeypatch.setattr(server, "MOST_OF_ONE_ADDRESS", 3)
    monkeypatch.setattr(server.PatientH11Protocol, "header_deadline_s", 600.0)
    monkeypatch.setattr(server, "is_loopback", lambda address: address != "127.0.0.1")
    url = serve(Settings(data=tmp_path / "data"))
    behind_proxy = serve(Settings(data=tmp_path / "other", proxies="127.0.0.0/31"))
    opened = [
        socket.create_connection(("127.0.0.1", int(each.rpartition(":")[2])), timeout=120)
        for each in (url, behind_proxy)
        for _ in range(3)
    ]
    try:
        assert httpx.get(f"{behind_proxy}/v1/health/live", trust_env=False).status_code == 200
        with pytest.raises(httpx.TransportError):
            httpx.get(f"{url}/v1/health/live", trust_env=False)
        other = httpx.HTTPTransport(local_address="127.0.0.2")
        with httpx.Client(transport=other, base_url=url) as http:
            assert http.get("/v1/health/live").status_code == 200
    finally:
        for connection in opened:
            connection.close()
