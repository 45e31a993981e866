"""A real application on a folder of its own, and take tables to feed it."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import numpy as np
import pytest
import uvicorn
from anyio.from_thread import start_blocking_portal
from fastapi import FastAPI

from glovecal_client.rest import RestClient
from glovecal_service.rest.app import create_app
from glovecal_service.rest.http.server import server_config
from glovecal_service.rest.in_process import PortalTransport, in_process_client
from glovecal_service.settings import Settings


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(data=tmp_path / "data", upload_limit_mb=16)


@pytest.fixture
def client(settings: Settings) -> Iterator[RestClient]:
    with in_process_client(settings) as client:
        yield client


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RestClient]:
    """One client for the tests of a module that change nothing; subject ``anna`` is there."""
    settings = Settings(data=tmp_path_factory.mktemp("shared") / "data", upload_limit_mb=16)
    with in_process_client(settings) as client:
        client.post("/subjects", {"name": "anna"})
        yield client


@pytest.fixture(scope="module")
def http(tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx.Client]:
    """Raw HTTP to an application that the tests of one module share."""
    settings = Settings(data=tmp_path_factory.mktemp("shared") / "data", upload_limit_mb=1)
    app = create_app(settings)
    with (
        start_blocking_portal() as portal,
        portal.wrap_async_context_manager(app.router.lifespan_context(app)),
        httpx.Client(transport=PortalTransport(app, portal), base_url="http://localhost/v1") as http,
    ):
        yield http


@pytest.fixture(scope="module")
def serve() -> Iterator[Callable[..., str]]:
    """Starts real uvicorn servers on free loopback ports; gives their addresses."""
    running: list[tuple[uvicorn.Server, threading.Thread]] = []

    def start(
        settings: Settings, *, body_patience_s: float = 30.0, more: Callable[[FastAPI], None] | None = None
    ) -> str:
        listener = socket.create_server(("127.0.0.1", 0))
        port = listener.getsockname()[1]
        app = create_app(settings, body_patience_s=body_patience_s)
        if more is not None:
            more(app)
        server = uvicorn.Server(server_config(app, "127.0.0.1", port, proxies=settings.known_proxies))
        thread = threading.Thread(target=server.run, args=([listener],))
        thread.start()
        running.append((server, thread))
        until = time.monotonic() + 120
        while not server.started and time.monotonic() < until:
            time.sleep(0.01)
        assert server.started
        return f"http://127.0.0.1:{port}"

    yield start
    for server, _ in running:
        server.should_exit = True
    for _, thread in running:
        thread.join(120)
        assert not thread.is_alive()


@pytest.fixture
def write_table(tmp_path: Path) -> Callable[..., Path]:
    """Writes a take table of two sensors whose rotations are known functions of the readings."""

    def write(
        name: str = "first.csv",
        takes: tuple[str, ...] = ("a", "b"),
        frames: int = 120,
        *,
        seed: int = 0,
        reference: bool = True,
    ) -> Path:
        random = np.random.default_rng(seed)
        rows = ["time_s,take,s.I_MCP,s.I_PIP" + (",r.I_MCP,r.I_PIP" if reference else "")]
        for take in takes:
            for frame in range(frames):
                x, y = random.uniform(20, 220, 2).round(3)
                angles = f",{0.4 * x + random.normal(0, 0.5):.4f},{0.3 * y:.4f}" if reference else ""
                rows.append(f"{frame / 100},{take},{x},{y}{angles}")
        path = tmp_path / name
        path.write_text("\n".join(rows) + "\n")
        return path

    return write
