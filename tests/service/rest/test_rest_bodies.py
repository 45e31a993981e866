"""Bodies that are too large, too slow or never end; 1 GB leaves no trace in memory or on disk."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import psutil
import pytest
from fastapi import WebSocket
from free_ports import free_port
from websockets.sync.client import connect
from websockets.typing import Origin

from glovecal_service.settings import Settings

SERVER = """
import sys
import uvicorn
from glovecal_service.rest.app import create_app
from glovecal_service.rest.http.server import server_config
from glovecal_service.settings import Settings
settings = Settings(data=sys.argv[1], upload_limit_mb=256)
uvicorn.Server(server_config(create_app(settings), "127.0.0.1", int(sys.argv[2]))).run()
"""


@pytest.fixture(scope="module")
def process(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, psutil.Process, Path]]:
    """A server in a process of its own, so that its memory can be read."""
    port = free_port()
    data = tmp_path_factory.mktemp("process") / "data"
    running = subprocess.Popen([sys.executable, "-c", SERVER, str(data), str(port)])
    url = f"http://127.0.0.1:{port}"
    try:
        _wait_until_live(url, running)
        yield url, psutil.Process(running.pid), data
    finally:
        running.terminate()
        running.wait(120)


def test_a_gigabyte_is_refused_without_memory(process: tuple[str, psutil.Process, Path]) -> None:
    url, server, data = process
    block = os.urandom(2**20)
    before = server.memory_info().rss
    most = before

    def endless() -> Iterator[bytes]:
        nonlocal most
        for number in range(1024):
            if number % 16 == 0:
                most = max(most, server.memory_info().rss)
            yield block

    with httpx.Client(base_url=f"{url}/v1", timeout=120, trust_env=False) as http:
        headers = {"Content-Type": "text/csv"}
        answer = http.post("/takes", params={"subject": "anna"}, content=endless(), headers=headers)
        assert answer.status_code == 413, answer.text
        assert answer.json()["limit_bytes"] == 256_000_000
        assert "256 MB" in answer.json()["detail"]
        after = server.memory_info().rss
        assert max(most, after) - before < 64e6
        assert list((data / "uploads").iterdir()) == []
        assert http.get("/health/live").status_code == 200


def test_a_declared_gigabyte_is_refused_before_it_is_sent(process: tuple[str, psutil.Process, Path]) -> None:
    url, _, data = process
    host, port = url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port)), timeout=120) as raw:
        raw.sendall(
            b"POST /v1/takes?subject=anna HTTP/1.1\r\nHost: localhost\r\nContent-Type: text/csv\r\n"
            b"Expect: 100-continue\r\nContent-Length: 1000000000\r\n\r\n"
        )
        answer = raw.recv(65536)
    assert answer.startswith(b"HTTP/1.1 413")
    assert list((data / "uploads").iterdir()) == []


def test_limits_differ_by_route(http: httpx.Client) -> None:
    large = {"readings": [[0.1234567890123456] * 500] * 1000}
    body = json.dumps(large)
    assert len(body) > 8_000_000
    answer = http.post("/models/abcdef/predict", content=body, headers={"Content-Type": "application/json"})
    assert answer.status_code == 413
    chunks = (body[at : at + 65536].encode() for at in range(0, len(body), 65536))
    answer = http.post("/models/abcdef/predict", content=chunks, headers={"Content-Type": "application/json"})
    assert answer.status_code == 413
    table = b"x" * 1_100_000
    for method, path in [("POST", "/takes?subject=anna"), ("POST", "/uploads")]:
        answer = http.request(method, path, content=table, headers={"Content-Type": "text/csv"})
        assert answer.status_code == 413, path


def test_a_page_of_the_studio_sends_files_as_large_as_rest_takes(http: httpx.Client) -> None:
    page = "http://localhost/studio/_nicegui/client/0f9c/upload/17"
    assert http.post(page, files={"model": b"x" * 1_000_000}).status_code == 404  # there is no such page
    assert http.post(page, files={"model": b"x" * 1_100_000}).status_code == 413


@pytest.mark.parametrize("declared", ["-1", "abc", "1e9", "9" * 50])
def test_lying_lengths(serve: Callable[..., str], tmp_path: Path, declared: str) -> None:
    url = serve(Settings(data=tmp_path / "data"))
    answer = _exchange(
        url,
        b"POST /v1/subjects HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
        b"Content-Length: " + declared.encode() + b"\r\n\r\n{}",
    )
    assert answer.startswith((b"HTTP/1.1 400", b"HTTP/1.1 413")), answer


def test_slow_bodies_and_headers_are_ended(
    serve: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("glovecal_service.rest.http.server.PatientH11Protocol.header_deadline_s", 0.6)
    url = serve(Settings(data=tmp_path / "data"), body_patience_s=0.5)
    slow_body = (
        b"POST /v1/takes?subject=anna HTTP/1.1\r\nHost: localhost\r\nContent-Type: text/csv\r\n"
        b"Content-Length: 1000\r\n\r\ntime_s"
    )
    answer = _exchange(url, slow_body)
    assert answer.startswith(b"HTTP/1.1 408"), answer
    assert b"body-too-slow" in answer
    assert list((tmp_path / "data" / "uploads").iterdir()) == []
    assert _exchange(url, b"GET /v1/health/live HTTP/1.1\r\nHost: local") == b""
    assert httpx.get(f"{url}/v1/health/live", trust_env=False).status_code == 200


def test_a_websocket_outlasts_the_time_for_headers(
    serve: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def echo(line: WebSocket) -> None:
        await line.accept()
        await line.send_text(await line.receive_text())

    monkeypatch.setattr("glovecal_service.rest.http.server.PatientH11Protocol.header_deadline_s", 0.6)
    url = serve(Settings(data=tmp_path / "data"), more=lambda app: app.add_api_websocket_route("/echo", echo))
    with connect(f"ws{url.removeprefix('http')}/echo", origin=Origin(url), proxy=None) as line:
        assert _exchange(url, b"GET /v1/health/live HTTP/1.1\r\nHost: local") == b"", "begun later, and ended"
        line.send("still there")
        assert line.recv(120) == "still there"


def test_many_slow_connections_do_not_keep_others_out(serve: Callable[..., str], tmp_path: Path) -> None:
    url = serve(Settings(data=tmp_path / "data"))
    host, port = url.removeprefix("http://").split(":")
    slow = [socket.create_connection((host, int(port)), timeout=120) for _ in range(200)]
    try:
        for number, connection in enumerate(slow):
            half = b"POST /v1/uploads HTTP/1.1\r\nHost: localhost\r\nContent-Type: text/csv\r\n"
            whole = half + b"Transfer-Encoding: chunked\r\n\r\n5\r\nhello\r\n"
            connection.sendall(half if number % 2 else whole)
        with httpx.Client(base_url=f"{url}/v1", trust_env=False) as http:
            for _ in range(20):
                assert http.get("/health/live").status_code == 200
            assert http.post("/subjects", json={"name": "anna"}).status_code == 201
    finally:
        for connection in slow:
            connection.close()


def test_a_connection_that_ends_within_the_body_leaves_nothing(
    serve: Callable[..., str], tmp_path: Path
) -> None:
    url = serve(Settings(data=tmp_path / "data"))
    host, port = url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port)), timeout=120) as raw:
        raw.sendall(
            b"POST /v1/uploads HTTP/1.1\r\nHost: localhost\r\nContent-Type: text/csv\r\n"
            b"Content-Length: 100000\r\n\r\n" + b"x" * 50_000
        )
    uploads = tmp_path / "data" / "uploads"
    until = time.monotonic() + 120
    while list(uploads.iterdir()) and time.monotonic() < until:
        time.sleep(0.01)
    assert list(uploads.iterdir()) == []


def _exchange(url: str, request: bytes) -> bytes:
    host, port = url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port)), timeout=120) as raw:
        raw.sendall(request)
        return b"".join(iter(lambda: raw.recv(65536), b""))


def _wait_until_live(url: str, running: subprocess.Popen[bytes]) -> None:
    until = time.monotonic() + 120
    while time.monotonic() < until:
        assert running.poll() is None
        try:
            if httpx.get(f"{url}/v1/health/live", trust_env=False).status_code == 200:
                return
        except httpx.TransportError:
            time.sleep(0.05)
    raise AssertionError("the server did not start")
