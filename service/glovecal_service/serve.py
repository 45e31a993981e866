"""``glovecal serve``: starts the service's processes, restarts one that dies, stops all of them cleanly.

Processes, none of which needs another to be alive but for the router: real time (zenoh router and prediction;
more than one share the gloves), recorder (its disk and database must never make a pose wait) and web (REST).

On Linux they are forked from this process, which has imported what real time needs: a fresh interpreter takes
a second for that, on a busy computer five, in which there are no poses. This process opens no zenoh session,
as a forked one delivers nothing. Elsewhere the system's libraries do not survive a fork, and each is fresh.
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
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field
from importlib.util import find_spec
from multiprocessing.process import BaseProcess
from threading import Event, Thread
from typing import Any, Protocol

from glovecal_client.errors import ClientError
from glovecal_client.hosts import is_loopback
from glovecal_client.installation import not_installed
from glovecal_client.operating_system import HANG_UP, STOP_SIGNALS, listen_alone
from glovecal_client.private_files import keep_private
from glovecal_client.program import (
    guard_streams,
    handle_signals,
    leave_signals_to_the_parent,
    say,
)
from glovecal_client.session import encrypted
from glovecal_client.site.certificates import check_certificate
from glovecal_client.site.member import read_member
from glovecal_models.errors import BadInput, GlovecalError
from glovecal_service.logs import Word, log_to_stderr
from glovecal_service.operating_system import FORKS, children_context, open_many_files
from glovecal_service.plain import reason_of
from glovecal_service.pulses import Pulses
from glovecal_service.rest.http.request_guard import asks_who
from glovecal_service.restarts import Restarts
from glovecal_service.settings import Settings
from glovecal_service.store.data_folder_lock import DataFolderLock, FolderInUse
from glovecal_service.store.errors import StoreUnavailable
from glovecal_service.store.site.site_folder import SiteFolder
from glovecal_service.store.store import Store

FIRST_DELAY_S = 0.1
LONGEST_DELAY_S = 10.0
HEALTHY_AFTER_S = 30.0
"""A process that lived this long begins with the first delay again."""
QUICK_CRASHES = 20
"""So many crashes in a row are answered with the first delay, by a process that gets as far as serving."""
STOP_WITHIN_S = 10.0

NAMED = "glovecal "
"""What the systems' names of processes begin with."""
READY_WITHIN_S = 60.0
DATABASE_WITHIN_S = 60.0

Work = Callable[[Settings, Event, Callable[[], None]], None]
"""Runs until the event is set; calls the last argument when it is there for its users."""

_CONTEXT = children_context()
_log = logging.getLogger("glovecal.serve")


class Ready:
    """Whether a process is there for its users. An Event has a lock, which a killed process may keep."""

    def __init__(self) -> None:
        self._flag = _CONTEXT.RawValue("b", 0)

    def set(self) -> None:
        self._flag.value = 1

    def is_set(self) -> bool:
        return bool(self._flag.value)


class PipeEnd(Protocol):
    """Of two classes: Windows has one of its own."""

    def recv_bytes(self) -> bytes: ...

    def close(self) -> None: ...


class Lifeline:
    """A pipe from this process to all its children, on which nothing is ever sent.

    It breaks when this process wants them to stop and when it is gone: a killed supervisor must not leave
    processes that hold its ports. No signal is needed, which Windows has not.
    """

    def __init__(self, end: PipeEnd, held: PipeEnd | None) -> None:
        """``held`` is the parent's end; a forked child has a copy of it, which would keep the pipe whole."""
        self._end = end
        self._held = held

    def of_a_child(self) -> Lifeline:
        return self if FORKS else Lifeline(self._end, None)

    def hold(self, stopped: Event) -> None:
        """In a child: set ``stopped`` when it breaks."""
        self.cut()
        with suppress(EOFError, OSError):
            self._end.recv_bytes()
        stopped.set()

    def cut(self) -> None:
        if self._held is not None:
            self._held.close()


@dataclass
class Part:
    """One supervised process."""

    name: str
    work: Work
    listens: tuple[str, str, int] | None = None
    """What is served where: ``("REST", host, port)``."""
    ready: Ready = field(default_factory=Ready)
    """Set by the process, anew after each start."""
    process: BaseProcess | None = None
    started_at: float = 0.0
    start_at: float = 0.0
    crashes: int = 0
    """Ends in a row of a process that was ready, or that somebody else ended."""
    failed_starts: int = 0
    """Ends in a row of a process that gave up before it was ready."""


def serve(settings: Settings) -> int:
    """Run until asked to stop, as by Ctrl-C; the exit code. What no restart cures is told in one sentence."""
    parts = [
        Part("real time", real_time, ("zenoh", *_zenoh_address(settings))),
        *(Part(f"real time {number}", more_real_time) for number in range(2, settings.realtime + 1)),
        Part("recorder", recorder),
        *(Part(f"recorder {number}", recorder) for number in range(2, settings.recorders + 1)),
        Part("web", web, ("REST", settings.host, settings.port)),
    ]
    try:
        with DataFolderLock(settings.data) as lock:
            log_to_stderr(settings)
            return _serve(settings, parts, lock)
    except FolderInUse as error:
        problem = _ports_problem(parts) or str(error)
    except BadInput as error:
        problem = str(error)
    print(f"glovecal serve: {problem}", file=sys.stderr)
    return 1


def _serve(settings: Settings, parts: list[Part], lock: DataFolderLock) -> int:
    problem = _why_not(settings, parts)
    if problem:
        print(f"glovecal serve: {problem}", file=sys.stderr)
        return 1
    lock.say_who(f"process {os.getpid()} on {socket.gethostname()}, {_web_address(settings)}")
    stopped = Event()
    handle_signals(lambda *_: stopped.set(), *STOP_SIGNALS, *HANG_UP)
    open_many_files()
    import glovecal_service.realtime.process  # noqa: F401  # for the processes, also those after a crash

    Restarts(settings.data).forget()
    Pulses(settings.data).expect(part.name for part in parts)
    lifeline = Lifeline(*_CONTEXT.Pipe(duplex=False))
    try:
        for part in parts:
            _start(part, settings, lifeline)
        _supervise(parts, settings, lifeline, stopped)
    finally:
        _stop(parts, lifeline)
    return 0


def _supervise(parts: list[Part], settings: Settings, lifeline: Lifeline, stopped: Event) -> None:
    """Keep them alive; say where the service is as soon as all are ready (or one takes very long)."""
    said, late = False, time.monotonic() + READY_WITHIN_S
    while not stopped.wait(0.1):
        for part in parts:
            _keep_alive(part, settings, lifeline)
        waiting = [part.name for part in parts if not part.ready.is_set()]
        if not said and (not waiting or time.monotonic() > late):
            said = True
            say(_banner(settings))
            if waiting:
                _log.warning("not ready yet: %s", Word(", ".join(waiting)))


def _why_not(settings: Settings, parts: list[Part]) -> str:
    """Why the service cannot start here, "" if it can. Also brings the store up to date, once for all."""
    if problem := _others_problem(settings) or _ports_problem(parts):
        return problem
    if settings.studio and find_spec("nicegui") is None:
        return f"{not_installed('the studio', 'nicegui')} (or leave it out: glovecal serve --no-studio)"
    try:
        with _store_that_answers(settings) as store:
            if asks_who(settings) and not (store.keys.has_admin or store.people.has_admin):
                return (
                    f"on {settings.host} the service asks everybody who they are (GLOVECAL_HOST, "
                    "GLOVECAL_LOGIN, GLOVECAL_PROXIES), and there is no admin yet; make one: glovecal key "
                    "add NAME --role admin"
                )
    except (GlovecalError, OSError) as error:
        return f"the store cannot be opened: {reason_of(error)}"
    return ""


def _store_that_answers(settings: Settings) -> Store:
    """Waits for a database server that is still starting. Raises as ``Store.open`` does."""
    until, is_logged = time.monotonic() + DATABASE_WITHIN_S, False
    while True:
        try:
            return Store.open(settings)
        except StoreUnavailable as error:
            if settings.database is None or time.monotonic() > until:
                raise
            if not is_logged:
                _log.warning("waiting %.0f s for the database: %s", DATABASE_WITHIN_S, error)
            is_logged = True
            time.sleep(0.5)


def _others_problem(settings: Settings) -> str:
    """Beyond loopback nobody is served without certificates, and services that are linked keep things
    together; "" if all is well."""
    places = {"GLOVECAL_DATABASE": settings.database, "GLOVECAL_ARTIFACTS": settings.artifacts}
    apart = [variable for variable, place in places.items() if not place]
    if settings.linked_routers and apart:
        return (
            "GLOVECAL_ZENOH_PEERS links this service to others, and they have the same models and takes with "
            f"one database and one object store only: set {' and '.join(apart)}, too"
        )
    for variable, host in (("GLOVECAL_HOST", settings.host), ("GLOVECAL_ZENOH", _zenoh_host(settings))):
        if settings.site_file is None and not is_loopback(host):
            return (
                f"{variable} lets other computers in ({host}), and nothing would be encrypted. Make "
                "certificates with `glovecal site init --host NAME`, and name the file that it writes in "
                "GLOVECAL_SITE_FILE"
            )
    if settings.site_file is None:
        return ""
    if not settings.site_file.exists():
        return f"there is no file {settings.site_file}; make it with `glovecal site init --host NAME`"
    try:
        member = read_member(settings.site_file)
        check_certificate(member)
        register = SiteFolder(settings.data).register()
    except (ClientError, GlovecalError) as error:
        return reason_of(error)
    if member.kind != "service":
        return (
            f"{settings.site_file} is the file of a {member.kind}; name the service's own, "
            f"{SiteFolder(settings.data).service_file}, in GLOVECAL_SITE_FILE"
        )
    if not member.site == settings.site == register.site:
        return (
            f"{settings.site_file} is of site {member.site!r}, {SiteFolder(settings.data).folder} of "
            f"{register.site!r}, and GLOVECAL_SITE is {settings.site!r}: they must be one"
        )
    return ""


def _zenoh_host(settings: Settings) -> str:
    """The host that the router listens on, "127.0.0.1" for what no other computer reaches."""
    host, port = _zenoh_address(settings)
    if port or host:
        return host
    return "127.0.0.1" if settings.zenoh.startswith(("unixsock-stream/", "unixpipe/")) else "0.0.0.0"


def _ports_problem(parts: list[Part]) -> str:
    return next(filter(None, map(_port_problem, parts)), "")


def _zenoh_address(settings: Settings) -> tuple[str, int]:
    """Host and port of an endpoint such as ``tcp/127.0.0.1:7447``; port 0 for one that is no TCP port."""
    protocol, _, address = settings.zenoh.partition("/")
    host, _, port = address.partition("#")[0].rpartition(":")
    if protocol not in ("tcp", "tls") or not port.isdecimal():
        return "", 0
    return host.strip("[]"), int(port)


def _port_problem(part: Part) -> str:
    what, host, port = part.listens or ("", "", 0)
    if not port:
        return ""
    try:
        family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            listen_alone(probe)
            probe.bind(address)
    except OSError as error:
        variable = "GLOVECAL_PORT" if what == "REST" else "GLOVECAL_ZENOH"
        return (
            f"{what} cannot listen on {host}:{port} ({reason_of(error)}); is another service "
            f"running? Stop it or choose another address with {variable}"
        )
    return ""


def _banner(settings: Settings) -> str:
    web = _web_address(settings)
    studio = f"\n  studio  {web}/studio/live" if settings.studio else ""
    return (
        "Glovecal is running. Ctrl-C stops it.\n"
        f"  REST    {web}/v1  (in a browser: / and /docs)\n"
        f"  zenoh   {_zenoh_shown(settings)}, keys glovecal/{settings.site}/<glove>/...\n"
        f"  data    {settings.data.resolve()}"
        f"{studio}"
    )


def _web_address(settings: Settings) -> str:
    shown = f"[{settings.host}]" if ":" in settings.host else settings.host
    return f"{'http' if settings.site_file is None else 'https'}://{shown}:{settings.port}"


def _zenoh_shown(settings: Settings) -> str:
    return settings.zenoh if settings.site_file is None else encrypted(settings.zenoh)


def _start(part: Part, settings: Settings, lifeline: Lifeline) -> None:
    part.ready = Ready()
    part.process = _CONTEXT.Process(
        target=run_part,
        args=(part.work, settings, part.ready, lifeline.of_a_child()),
        name=f"{NAMED}{part.name}",
    )
    part.process.start()
    part.started_at = time.monotonic()


def _keep_alive(part: Part, settings: Settings, lifeline: Lifeline) -> None:
    now = time.monotonic()
    if part.process is None:
        if now >= part.start_at:
            _start(part, settings, lifeline)
        return
    if part.process.is_alive():
        return
    code = part.process.exitcode
    part.process = None
    delay_s = _delay_s(part, code, now - part.started_at)
    part.start_at = now + delay_s
    why = _port_problem(part) if part.failed_starts else ""
    ending = f"exit code {code}: {why}" if why else f"exit code {code}"
    if part.work in (real_time, more_real_time):
        Restarts(settings.data).note()
    _log.warning("%s ended (%s); starting it again in %.2g s", Word(part.name), Word(ending), delay_s)


def _delay_s(part: Part, code: int | None, lived_s: float) -> float:
    """What crashes is back at once, for a pose is waited for; what cannot even start is given time."""
    if lived_s >= HEALTHY_AFTER_S:
        part.crashes = part.failed_starts = 0
    if part.ready.is_set() or (code is not None and code < 0):
        part.failed_starts = 0
        part.crashes += 1
    else:
        part.failed_starts += 1
    doublings = max(part.failed_starts, part.crashes - QUICK_CRASHES, 0)
    return min(FIRST_DELAY_S * 2.0**doublings, LONGEST_DELAY_S)


def _stop(parts: list[Part], lifeline: Lifeline) -> None:
    """Ask all at once; kill what does not stop in time."""
    running = [part.process for part in parts if part.process is not None]
    lifeline.cut()
    deadline = time.monotonic() + STOP_WITHIN_S
    for process in running:
        process.join(max(0.1, deadline - time.monotonic()))
        if process.is_alive():
            _log.warning("%s does not stop; killing it", Word(process.name))
            process.kill()
            process.join()


def run_part(work: Work, settings: Settings, ready: Any, lifeline: Lifeline) -> None:
    """What a child does first: see to it that it stops when asked, and when the parent is gone, and that
    it is seen to live."""
    guard_streams()
    settle = log_to_stderr(settings)
    keep_private()
    stopped = Event()
    leave_signals_to_the_parent()
    handle_signals(lambda *_: stopped.set(), signal.SIGTERM)
    Thread(target=lifeline.hold, args=(stopped,), daemon=True).start()
    name = multiprocessing.current_process().name
    Thread(target=Pulses(settings.data).beat, args=(name.removeprefix(NAMED), stopped), daemon=True).start()
    try:
        work(settings, stopped, ready.set)
    except Exception as error:
        _log.error("%s: %s", Word(name), error)
        sys.exit(1)
    finally:
        settle()


def real_time(settings: Settings, stopped: Event, started: Callable[[], None]) -> None:
    """The real-time process."""
    from glovecal_service.realtime.process import run_real_time

    run_real_time(settings, stopped, started)


def more_real_time(settings: Settings, stopped: Event, started: Callable[[], None]) -> None:
    """A further process that has a share of the gloves."""
    from glovecal_service.realtime.process import run_more_real_time

    run_more_real_time(settings, stopped, started)


def recorder(settings: Settings, stopped: Event, started: Callable[[], None]) -> None:
    """The recorder process."""
    from glovecal_service.recorder.recorder import run_recorder

    run_recorder(settings, stopped, started)


def web(settings: Settings, stopped: Event, started: Callable[[], None]) -> None:
    """The web process."""
    import uvicorn

    from glovecal_service.rest.app import create_app
    from glovecal_service.rest.http.server import server_config
    from glovecal_service.store.site.web_login import WebLogin

    app = create_app(settings)
    if settings.studio:
        from glovecal_service.studio.mount import mount_studio

        mount_studio(app, settings)
    context = None
    if settings.site_file is not None:
        login = WebLogin(settings, app.state.allowed_hosts)
        context = login.context
        Thread(target=login.follow, args=(stopped,), daemon=True).start()
    config = server_config(app, settings.host, settings.port, context, settings.known_proxies)
    server = uvicorn.Server(config)
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
