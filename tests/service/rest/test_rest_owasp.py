"""The OWASP API Security Top 10 (2023), as far as they apply to a service on loopback.

There whoever reaches the port may do everything, so it must be hard to reach for anyone else (API7, API8),
nothing may run away with the machine (API4), and everything served is documented (API9). What is about users
and rights (API1, 2, 3 and 5) is held in ``test_rest_access.py``, for a service that asks for keys.
"""

from __future__ import annotations

import json
import logging
import os
import re
import socket
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
from anyio.from_thread import start_blocking_portal

from glovecal_client.rest import Refused, RestClient
from glovecal_service.rest.app import create_app
from glovecal_service.rest.http.request_guard import BodyGuard, is_loopback
from glovecal_service.rest.in_process import PortalTransport
from glovecal_service.settings import Settings
from glovecal_service.store.errors import StoreDamaged


def test_api3_bodies_take_nothing_that_is_not_documented(http: httpx.Client) -> None:
    for extra in ("created_at", "id", "active", "__proto__", "admin"):
        assert http.post("/subjects", json={"name": "eve", extra: 1}).status_code == 422
    assert http.get("/subjects/eve").status_code == 404


def test_api4_every_route_bounds_its_body(http: httpx.Client) -> None:
    chunk = b"[" * 65536
    for path, operations in http.get("/openapi.json").json()["paths"].items():
        for method in operations:
            if method in ("post", "put"):
                url = "http://localhost" + re.sub(r"\{[^}]+\}", "abcdefabcdef", path)
                answer = http.request(
                    method,
                    url,
                    params={"subject": "anna"},
                    content=(chunk for _ in range(200)),
                    headers={"Content-Type": "text/csv" if "readings" not in path else "application/json"},
                )
                assert answer.status_code in (404, 413, 422, 415), (method, path, answer.status_code)


def test_api4_the_slowest_and_the_largest_body_have_bounds() -> None:
    guard = BodyGuard(lambda *_: None, limit=lambda _: 1)  # type: ignore[arg-type, return-value]
    assert guard.patience_s <= 30
    assert Settings().upload_limit_mb <= 256


@pytest.mark.parametrize(
    "host", ["evil.example", "localhost.evil.example", "127.0.0.1.nip.io", "192.168.1.5", "", "[", "a" * 300]
)
def test_api7_other_host_names_are_turned_away(http: httpx.Client, host: str) -> None:
    """DNS rebinding: a page of evil.example, whose name now points at 127.0.0.1."""
    answer = http.get("/subjects", headers={"Host": host})
    assert answer.status_code == 421
    assert answer.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize(
    "host", ["localhost", "localhost:8600", "127.0.0.1:8600", "[::1]:8600", "127.0.0.2", "LOCALHOST"]
)
def test_api7_loopback_names_are_served(http: httpx.Client, host: str) -> None:
    assert http.get("/subjects", headers={"Host": host}).status_code == 200


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "https://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://localhost:9999"},
        {"Origin": "http://["},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site"},
    ],
)
def test_api7_pages_of_other_sites_change_nothing(http: httpx.Client, headers: dict[str, str]) -> None:
    for method, path in [("POST", "/subjects"), ("DELETE", "/subjects/anna"), ("POST", "/uploads")]:
        answer = http.request(method, path, content=b'{"name": "eve"}', headers=headers)
        assert answer.status_code == 403, path
    assert "access-control-allow-origin" not in http.get("/subjects", headers=headers).headers


def test_api7_the_own_page_may_change_things(http: httpx.Client) -> None:
    headers = {"Origin": "http://localhost", "Sec-Fetch-Site": "same-origin"}
    assert http.post("/subjects", json={"name": "own-page"}, headers=headers).status_code == 201


def test_api8_only_loopback_by_default_and_no_wildcards(serve: Callable[..., str], tmp_path: Path) -> None:
    assert is_loopback(Settings().host)
    for name in ("0.0.0.0", "::", "", "localhost.example", "128.0.0.1", "evil"):
        assert not is_loopback(name)
    url = serve(Settings(data=tmp_path / "data"))
    port = int(url.rpartition(":")[2])
    own_address = _address_of_this_machine()
    if own_address is not None:
        with pytest.raises(OSError, match="refused"):
            socket.create_connection((own_address, port), timeout=2)


def test_api8_answers_tell_nothing_of_the_inside(serve: Callable[..., str], tmp_path: Path) -> None:
    url = serve(Settings(data=tmp_path / "data"))
    answer = httpx.get(f"{url}/v1/subjects/nobody", trust_env=False)
    assert "server" not in answer.headers
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert str(tmp_path) not in answer.text
    assert httpx.get(f"{url}/redoc", trust_env=False).status_code == 404


def test_api8_a_failure_inside_is_logged_not_shown(
    shared: RestClient, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(*_: Any) -> None:
        raise RuntimeError("the secret inside")

    monkeypatch.setattr("glovecal_service.store.subjects.Subjects.page", fail)
    caplog.set_level(logging.INFO, "glovecal.rest")
    with pytest.raises(Refused) as refused:
        shared.get("/subjects")
    problem = refused.value.problem
    assert problem["status"] == 500
    assert "secret" not in json.dumps(problem)
    records = [json.loads(record.getMessage()) for record in caplog.records]
    assert "the secret inside" in (caplog.records[0].exc_text or "")
    assert {record["request_id"] for record in records} == {problem["request_id"]}
    assert records[1]["status"] == 500


def test_api8_the_log_holds_no_secrets(http: httpx.Client, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "glovecal.rest")
    secret = "s3cr3t-value"
    answer = http.get(
        "/subjects",
        params={"token": secret},
        headers={"Authorization": f"Bearer {secret}", "Cookie": secret, "X-Request-Id": "chosen-by-me-1"},
    )
    assert answer.headers["x-request-id"] == "chosen-by-me-1"
    http.get("/subjects/%0d%0aforged", headers={"X-Request-Id": 'bad"id, {"forged": 1}'})
    lines = [record.getMessage() for record in caplog.records]
    assert len(lines) == 2
    assert all(secret not in line and "\n" not in line for line in lines)
    first = json.loads(lines[0])
    assert (first["method"], first["route"], first["status"]) == ("GET", "/v1/subjects", 200)


def test_api9_everything_served_is_documented(http: httpx.Client) -> None:
    document = http.get("/openapi.json").json()
    operations = [operation for path in document["paths"].values() for operation in path.values()]
    assert len(operations) >= 30
    for operation in operations:
        assert operation["summary"]
        assert {"404", "421", "422", "500", "503"} <= set(operation["responses"])
        for status, answer in operation["responses"].items():
            if int(status) >= 400:
                assert list(answer["content"]) == ["application/problem+json"]
    assert "HTTPValidationError" not in document["components"]["schemas"]


def test_health_and_metrics(shared: RestClient) -> None:
    assert shared.get("/health/live") == {"status": "alive", "processes_seen_s_ago": {}}
    with pytest.raises(Refused, match="no glove is served: the real-time process was never seen") as refused:
        shared.get("/health/ready")
    assert refused.value.status == 503
    for path in ("/subjects/nobody", "/subjects/someone", "/nothing/at/all"):
        with pytest.raises(Refused):
            shared.get(path)
    text = shared.download("/metrics").decode()
    assert 'glovecal_http_requests_total{method="GET",route="/v1/subjects/{name}",status="404"} 2.0' in text
    assert 'route="unmatched",status="404"' in text
    assert "someone" not in text


def test_ready_says_what_does_not_work(shared: RestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    def damaged(*_: Any) -> None:
        raise StoreDamaged("the database file is damaged; restore a backup")

    monkeypatch.setattr("glovecal_service.store.subjects.Subjects.count", damaged)
    with pytest.raises(Refused, match="damaged") as refused:
        shared.get("/health/ready")
    assert refused.value.status == 503
    assert shared.get("/health/live") == {"status": "alive", "processes_seen_s_ago": {}}


def test_nothing_outside_the_data_folder_is_opened(tmp_path: Path) -> None:
    """Audit hook (PEP 578): every file a hostile run opens lies in the data folder or is code."""
    data = tmp_path / "data"
    table = b"time_s,s.A,r.A\n0,1,1\n1,2,2\n"
    with _raw(data) as http, _opened_files() as opened:
        assert http.post("/subjects", json={"name": "anna"}).status_code == 201
        for name in (
            "../../etc/passwd",
            "..%2f..%2fetc",
            "/etc/passwd",
            "a\\..\\b",
            "~/x",
            "%2fetc%2fpasswd",
        ):
            for query in ({"filename": name}, {"name": name}, {"reference_upload": name}):
                http.post(
                    "/takes",
                    params={"subject": "anna", "filename": "a.csv", **query},
                    content=table,
                    headers={"Content-Type": "text/csv"},
                )
            for path in (f"/takes/{name}", f"/models/{name}/export", f"/gloves/{name}", f"/jobs/{name}"):
                assert http.get(path).status_code in (404, 422)
    assert any(path.startswith(str(data / "uploads")) for path in opened)
    code = (sys.prefix, sys.base_prefix, str(Path(__file__).parents[3]), "/usr/lib", "/proc", "/dev/null")
    assert [path for path in opened if not path.startswith((str(data), *code))] == []


@contextmanager
def _raw(data: Path) -> Iterator[httpx.Client]:
    app = create_app(Settings(data=data))
    with (
        start_blocking_portal() as portal,
        portal.wrap_async_context_manager(app.router.lifespan_context(app)),
        httpx.Client(transport=PortalTransport(app, portal), base_url="http://localhost/v1") as http,
    ):
        yield http


_listening: list[list[str]] = []


@contextmanager
def _opened_files() -> Iterator[list[str]]:
    """Paths of all files opened meanwhile. The hook cannot be removed, so it is told when to listen."""
    if not getattr(_audit, "installed", False):
        sys.addaudithook(_audit)
        _audit.installed = True  # type: ignore[attr-defined]
    opened: list[str] = []
    _listening.append(opened)
    try:
        yield opened
    finally:
        _listening.remove(opened)


def _audit(event: str, arguments: tuple[Any, ...]) -> None:
    if event == "open" and _listening and isinstance(arguments[0], str | bytes | Path):
        path = os.fsdecode(arguments[0])
        if Path(path).is_absolute():
            for opened in _listening:
                opened.append(path)


def _address_of_this_machine() -> str | None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))
        except OSError:
            return None
        address = probe.getsockname()[0]
    return None if is_loopback(address) else address
