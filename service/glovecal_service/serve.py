"""``glovecal serve``: starts the service's processes, restarts one that dies, stops all of them cleanly.

Three processes, none of which needs another to be alive: real time (zenoh router and prediction), recorder
(its disk and database must never make a pose wait) and web (REST). Each is a fresh interpreter: a forked
zenoh session delivers nothing.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import socket
import sys
import time
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, field
from multiprocessing.context import SpawnProcess
from threading import Event, Thread
from typing import Any

from glovecal_models.errors import GlovecalError
from glovecal_service.settings import Settings
from glovecal_service.store.store import Store

FIRST_DELAY_S = 0.25
LONGEST_DELAY_S = 10.0
HEALTHY_AFTER_S = 30.0
"""A process that lived this long is restarted without delay when it dies."""
STOP_WITHIN_S = 10.0

READY_WITHIN_S = 60.0

Work = Callable[[Settings, Event, Callable[[], None]], None]
"""Runs until the event is set; calls the last argument when it is there for its users."""

_SPAWN = multiprocessing.get_context("spawn")
_log = logging.getLogger("glovecal.serve")


@dataclass
class Part:
    """One supervised process."""

    name: str
    work: Work
    ready: Any = field(default_factory=lambda: _SPAWN.Event())
    """Set by the process when it is there for its users."""
    process: SpawnProcess | None = None
    started_at: float = 0.0
    start_at: float = 0.0
    delay_s: float = FIRST_DELAY_S
    starts: int = 0
    exits: list[int | None] = field(default_factory=list)


def serve(settings: Settings) -> int:
    """Run until SIGTERM or Ctrl-C; the exit code. Problems that no restart can cure are one sentence."""
    _log_to_stderr()
    problem = _why_not(settings)
    if problem:
        print(f"glovecal serve: {problem}", file=sys.stderr)
        return 1
    stopped = Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stopped.set())
    parts = [Part("real time", real_time), Part("recorder", recorder), Part("web", web)]
    try:
        for part in parts:
            _start(part, settings)
        _supervise(parts, settings, stopped)
    finally:
        _stop(parts)
    return 0


def _supervise(parts: list[Part], settings: Settings, stopped: Event) -> None:
    """Keep them alive; say where the service is as soon as all are ready (or one takes very long)."""
    said, late = False, time.monotonic() + READY_WITHIN_S
    while not stopped.wait(0.1):
        for part in parts:
            _keep_alive(part, settings)
        waiting = [part.name for part in parts if not part.ready.is_set()]
        if not said and (not waiting or time.monotonic() > late):
            said = True
            print(_banner(settings), flush=True)
            if waiting:
                _log.warning("not ready yet: %s", ", ".join(waiting))


def _why_not(settings: Settings) -> str:
    """Why the service cannot start here, "" if it can. Also brings the store up to date, once for all."""
    for what, host, port in (("REST", settings.host, settings.port), ("zenoh", *_zenoh_address(settings))):
        problem = _port_problem(what, host, port)
        if problem:
            return problem
    try:
        Store.open(settings).close()
    except (GlovecalError, OSError) as error:
        return f"the store cannot be opened: {error}"
    return ""


def _zenoh_address(settings: Settings) -> tuple[str, int]:
    """Host and port of an endpoint such as ``tcp/127.0.0.1:7447``; port 0 for one that is no TCP port."""
    protocol, _, address = settings.zenoh.partition("/")
    host, _, port = address.partition("#")[0].rpartition(":")
    if protocol not in ("tcp", "tls") or not port.isdecimal():
        return "", 0
    return host.strip("[]"), int(port)


def _port_problem(what: str, host: str, port: int) -> str:
    if not port:
        return ""
    try:
        family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
    except OSError as error:
        variable = "GLOVECAL_PORT" if what == "REST" else "GLOVECAL_ZENOH"
        return (
            f"{what} cannot listen on {host}:{port} ({error.strerror or error}); is another service "
            f"running? Stop it or choose another address with {variable}"
        )
    return ""


def _banner(settings: Settings) -> str:
    shown = f"[{settings.host}]" if ":" in settings.host else settings.host
    return (
        "Glovecal is running. Ctrl-C stops it.\n"
        f"  REST    http://{shown}:{settings.port}/v1  (in a browser: / and /docs)\n"
        f"  zenoh   {settings.zenoh}, keys glovecal/{settings.site}/<glove>/...\n"
        f"  data    {settings.data.resolve()}"
    )


def _start(part: Part, settings: Settings) -> None:
    part.process = _SPAWN.Process(
        target=run_part, args=(part.work, settings, part.ready, os.getpid()), name=f"glovecal {part.name}"
    )
    part.process.start()
    part.started_at = time.monotonic()
    part.starts += 1


def _keep_alive(part: Part, settings: Settings) -> None:
    now = time.monotonic()
    if part.process is None:
        if now >= part.start_at:
            _start(part, settings)
        return
    if part.process.is_alive():
        return
    code = part.process.exitcode
    part.exits.append(code)
    part.process = None
    if now - part.started_at >= HEALTHY_AFTER_S:
        part.delay_s = FIRST_DELAY_S
    part.start_at = now + part.delay_s
    _log.warning("%s ended (exit code %s); starting it again in %.2g s", part.name, code, part.delay_s)
    part.delay_s = min(2 * part.delay_s, LONGEST_DELAY_S)


def _stop(parts: list[Part]) -> None:
    """Ask all at once; kill what does not stop in time."""
    running = [part.process for part in parts if part.process is not None]
    for process in running:
        if process.is_alive():
            process.terminate()
    deadline = time.monotonic() + STOP_WITHIN_S
    for process in running:
        process.join(max(0.1, deadline - time.monotonic()))
        if process.is_alive():
            _log.warning("%s does not stop; killing it", process.name)
            process.kill()
            process.join()


def run_part(work: Work, settings: Settings, ready: Any, parent: int) -> None:
    """What a child does first: stop on signals, and when the parent is gone."""
    _log_to_stderr()
    stopped = Event()
    signal.signal(signal.SIGTERM, lambda *_: stopped.set())
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_follow_parent, args=(parent, stopped), daemon=True).start()
    try:
        work(settings, stopped, ready.set)
    except Exception as error:
        _log.error("%s: %s", multiprocessing.current_process().name, error)
        sys.exit(1)


def _follow_parent(parent: int, stopped: Event) -> None:
    """A killed supervisor must not leave processes that hold its ports."""
    while not stopped.wait(1.0):
        if os.getppid() != parent:
            stopped.set()


def real_time(settings: Settings, stopped: Event, started: Callable[[], None]) -> None:
    """The real-time process."""
    from glovecal_service.realtime.process import run_real_time

    run_real_time(settings, stopped, started)


def recorder(settings: Settings, stopped: Event, started: Callable[[], None]) -> None:
    """The recorder process."""
    from glovecal_service.realtime.recorder_process import run_recorder

    run_recorder(settings, stopped, started)


def web(settings: Settings, stopped: Event, started: Callable[[], None]) -> None:
    """The web process."""
    import uvicorn

    from glovecal_service.rest.app import create_app
    from glovecal_service.rest.server import server_config

    server = uvicorn.Server(server_config(create_app(settings), settings.host, settings.port))
    setattr(server, "capture_signals", nullcontext)  # noqa: B010  signals are ours, uvicorn takes them over
    Thread(target=_follow_server, args=(server, stopped, started), daemon=True).start()
    server.run()
    if not stopped.is_set():
        raise RuntimeError("the web server ended by itself")


def _follow_server(server: Any, stopped: Event, started: Callable[[], None]) -> None:
    while not server.started and not stopped.wait(0.05):
        pass
    started()
    stopped.wait()
    server.should_exit = True


def _log_to_stderr() -> None:
    logging.basicConfig(
        stream=sys.stderr, level=logging.INFO, format="%(asctime)s %(name)s %(levelname)s %(message)s"
    )
    for chatty in ("alembic", "uvicorn.error", "distributed"):
        logging.getLogger(chatty).setLevel(logging.WARNING)
