"""The worker processes, started when the first task needs them.

Dask distributed was chosen over procrastinate (needs PostgreSQL) and Ray (620 MB, 24 s to start): it starts
in 2 s with SQLite alone and retries a task whose worker died. It is trusted with nothing but running: the
database remembers jobs, the fits folder remembers results, and this process alone touches either. It is
imported at the first task too: importing it takes a second that short commands do not have.

Dask's processes run what they are sent, so they listen on loopback only and speak TLS, where both sides have
to show a certificate. It is made at their start and signs itself; its key is in their memory alone, so that
no other user of this computer can have it. Processes on other computers come through ``worker_entrance.py``.
"""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
import tempfile
import threading
import time
import uuid
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast
from weakref import WeakValueDictionary

from glovecal_client.errors import reason_of
from glovecal_models.errors import GlovecalError
from glovecal_service.jobs.dask_log import silence_dask
from glovecal_service.jobs.job_kind import Task, TaskReport
from glovecal_service.jobs.task_run import TaskOutcome
from glovecal_service.operating_system import FORKS
from glovecal_service.settings import Settings

if TYPE_CHECKING:
    from distributed import Client, Future, LocalCluster, Scheduler, Security

_log = logging.getLogger("glovecal.jobs")

START_TIMEOUT_S = 60
LOOK_S = 0.01
LONGEST_ABSENCE_S = 45.0
CONFIG = {
    "distributed.admin.large-graph-warning-threshold": "1GB",
    "distributed.scheduler.allowed-failures": 2,
    "distributed.comm.timeouts.connect": "30s",
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
    # Dask has every array above 128 kB mapped anew, which costs a diagnosis as much as its arithmetic. glibc
    # takes no more than 32 MiB for the second.
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 256 << 20,
    "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": 32 << 20,
    # What fills a worker's memory does not go to the disk, where it would lie as it is.
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
}
_FORKED = {"distributed.worker.multiprocessing-method": "forkserver"}
_LONGEST_FOLDER = 75
"""Bytes: the name of a socket in the folder for temporary files has to fit into 107."""
IMPORTED_ONCE = ["distributed", "distributed.nanny", "scipy.signal", "glovecal_service.questions.catalogue"]
"""SciPy's signal package brings those for optimisation and statistics, which diagnoses use."""


class WorkersLost(GlovecalError):
    """Nobody works any more; whatever was in flight has to be handed out again.

    ``client`` is the one that was lost, so that two jobs do not each throw away the other's new one.
    """

    def __init__(self, sentence: str, client: Client | None = None) -> None:
        super().__init__(sentence)
        self.client = client


class TaskKilledWorkers(GlovecalError):
    """A task brought down every process it was given to."""


@dataclass(frozen=True)
class Invitation:
    """What a process elsewhere needs to work for the scheduler of one start."""

    port: int
    """Of 127.0.0.1."""
    keys: Mapping[str, str]
    """PEM texts, as Dask names them: who has them may run code in all processes of that scheduler."""
    client: Client


class HandedOut:
    """A task on its way to a worker process, in it, or back. Whoever has it may drop it."""

    def __init__(self, task: Task, report: TaskReport) -> None:
        self._label = task.label
        self._report = report
        self._future: Future | None = None
        self._outcome: TaskOutcome | None = None
        self.weight = 0
        """Bytes."""

    def follow(self, future: Future, weight: int) -> None:
        """Dask's own word on it."""
        self._future, self.weight = future, weight

    def hear(self, sentence: str, share: float, detail: str) -> None:
        self._report(sentence, share, json.loads(detail))

    def end(self, **outcome: Any) -> None:
        self._outcome = TaskOutcome(**outcome)

    @property
    def is_over(self) -> bool:
        return self._outcome is not None or (self._future is not None and self._future.done())

    @property
    def outcome(self) -> TaskOutcome:
        """Once it is over. Raises WorkersLost, TaskKilledWorkers."""
        from distributed import KilledWorker

        future = self._future
        assert future is not None
        if self._outcome is not None:
            return self._outcome
        if future.status != "error":
            raise WorkersLost("the scheduler of the training processes was lost", future.client)
        error: Exception = cast(Any, future.exception())
        if isinstance(error, KilledWorker):
            raise TaskKilledWorkers(
                f"{self._label}: every process that worked on it died (killed, or out of memory)"
            ) from error
        raise error  # a mistake in what Dask was asked to do

    def drop(self) -> None:
        """Nobody wants it any more: a worker that has it stops."""
        if self._future is not None:
            self._future.release()


class Workers:
    """A Dask client that comes to life at the first ``submit``. Safe to use from several threads."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._lock = threading.Lock()
        self._client: Client | None = None
        self._cluster: LocalCluster | None = None
        self._security: Security | None = None
        self._absent_since: float | None = None
        self._closed = False
        self.refusal = ""
        """Why the last worker elsewhere that wanted to come in was not let in."""
        self._handed_out: WeakValueDictionary[str, HandedOut] = WeakValueDictionary()

    @property
    def started(self) -> bool:
        return self._client is not None

    @property
    def address(self) -> str | None:
        """Of the scheduler, None before it is started."""
        client = self._client
        return None if client is None or client.scheduler is None else str(client.scheduler.address)

    @property
    def count(self) -> int:
        """How many tasks run at once."""
        scheduler = self._scheduler
        return max(1, self._settings.workers, 0 if scheduler is None else scheduler.total_nthreads)

    @property
    def absence(self) -> str | None:
        """For a person: nobody is there to work, and this process starts nobody."""
        scheduler = self._scheduler
        if self._settings.workers or scheduler is None or scheduler.workers:
            return None
        why = f" (the last was refused: {self.refusal})" if self.refusal else ""
        return (
            "waiting for a worker: none is connected, and GLOVECAL_WORKERS=0 leaves training to others"
            f"{why}. Start one: glovecal worker, which says on its terminal what keeps it out"
        )

    @property
    def _scheduler(self) -> Scheduler | None:
        cluster = self._cluster
        return None if cluster is None else cast("Scheduler | None", cluster.scheduler)

    def invite(self) -> Invitation:
        """Start the scheduler, if need be, for processes elsewhere. Raises WorkersLost."""
        client, scheduler, security = self._started(), self._scheduler, self._security
        if scheduler is None or security is None:
            raise WorkersLost("the service has lost its scheduler", client)
        names = ("tls_ca_file", "tls_worker_cert", "tls_worker_key")
        port = int(scheduler.address.rpartition(":")[2])
        return Invitation(port, {name: str(getattr(security, name)) for name in names}, client)

    def is_current(self, invitation: Invitation) -> bool:
        return invitation.client is self._client

    def submit(self, task: Task, report: TaskReport) -> HandedOut:
        """Hand a task out; ``report`` is called in another thread. Raises WorkersLost."""
        from distributed.client import ClosedClientError

        from glovecal_service.jobs.task_in_worker import packed, work_off

        handed, key, sent = HandedOut(task, report), uuid.uuid4().hex, packed(task)
        self._handed_out[key] = handed
        client = None
        try:
            client = self._started()
            handed.follow(client.submit(work_off, sent, key=key), len(sent))
        except (OSError, TimeoutError, RuntimeError, ClosedClientError) as error:
            raise WorkersLost("the training processes cannot be reached", client) from error
        return handed

    def check(self) -> None:
        """Raise WorkersLost when every process of our own has been gone for long.

        Dask starts a killed process again, but gives up when that takes too long on a busy computer; tasks
        would then wait for ever.
        """
        client, scheduler = self._client, self._scheduler
        if client is None or scheduler is None or scheduler.workers or not self._settings.workers:
            self._absent_since = None
            return
        now = time.monotonic()
        self._absent_since = self._absent_since or now
        if now - self._absent_since > LONGEST_ABSENCE_S:
            raise WorkersLost("the training processes died and were not started again", client)

    def reset(self, lost: Client | None = None) -> None:
        """Forget the scheduler, so that the next ``submit`` finds or starts another.

        With ``lost``, only if that is still the client in use.
        """
        with self._lock:
            if lost is None or lost is self._client:
                self._close()

    def close(self) -> None:
        """For good: a job that was just about to start workers starts none."""
        with self._lock:
            self._closed = True
            self._close()

    def pids(self) -> list[int]:
        """Process ids of the workers, none before they are started."""
        cluster = self._cluster
        return [] if cluster is None else [each.pid for each in cluster.workers.values()]

    def _started(self) -> Client:
        from dask.config import set as configure
        from distributed import Client, Security

        silence_dask()
        with self._lock:
            if self._closed:
                raise WorkersLost("the service is stopping")
            if self._client is None:
                configure(CONFIG)
                if FORKS and len(os.fsencode(tempfile.gettempdir())) <= _LONGEST_FOLDER:
                    _import_once()
                try:
                    security = self._security = Security.temporary()
                    cluster = self._local_cluster(security)
                    self._client = Client(
                        cluster, security=security, timeout=START_TIMEOUT_S, set_as_default=False
                    )
                except (OSError, TimeoutError, RuntimeError) as error:
                    self._close()
                    raise WorkersLost(f"no training process can be started: {_reason(error)}") from error
                except BaseException:
                    self._close()
                    raise
            return self._client

    def _local_cluster(self, security: Security) -> LocalCluster:
        from distributed import LocalCluster

        folder = self._settings.fits_folder.resolve() / "workers"
        folder.mkdir(parents=True, exist_ok=True)
        self._cluster = LocalCluster(
            n_workers=self._settings.workers,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            security=security,
            dashboard_address="127.0.0.1:0",
            scheduler_kwargs={"dashboard": False},
            local_directory=str(folder),
            silence_logs=logging.CRITICAL,  # until a worker silences itself
            preload=["glovecal_service.jobs.worker_setup"],
        )
        scheduler, loop = self._cluster.scheduler, self._cluster.loop
        assert scheduler is not None
        assert loop is not None
        loop.add_callback(scheduler.http_server.stop)  # it has nothing to show
        self._listen(scheduler)
        return self._cluster

    def _listen(self, scheduler: Scheduler) -> None:
        """To what workers tell of tasks, in the scheduler's thread."""
        from glovecal_service.jobs.task_in_worker import OUTCOME, PROGRESS

        def progress(worker: str, key: str, **what: Any) -> None:
            if (handed := self._handed_out.get(key)) is not None:
                handed.hear(**what)

        def over(worker: str, key: str, **outcome: Any) -> None:
            if (handed := self._handed_out.get(key)) is not None:
                handed.end(**outcome)

        scheduler.stream_handlers.update({PROGRESS: progress, OUTCOME: over})

    def _close(self) -> None:
        client, self._client = self._client, None
        cluster, self._cluster = self._cluster, None
        self._absent_since = None
        for part, timeout_s in ((client, 5), (cluster, 10)):
            with suppress(TimeoutError, OSError):  # it is thrown away in any case
                if part is not None:
                    part.close(timeout=timeout_s)


def _reason(error: Exception) -> str:
    """Why no process starts; what Dask and Python say of it is for the log.

    One that dies before it can speak to Dask writes why to standard error: what it imports is imported once
    more to hear that.
    """
    _log.warning("no training process can be started", exc_info=error)
    if isinstance(error, TimeoutError):
        return f"none answered within {START_TIMEOUT_S} s"
    if isinstance(error, OSError):
        return reason_of(error)
    command = [sys.executable, "-P", "-c", "import " + ", ".join(IMPORTED_ONCE)]
    child = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    if child.returncode == 0:
        return "each ends while it starts; the service's log says more"
    _log.warning("what a training process imports: %s", child.stderr.strip())
    return "none can import what it needs; install Glovecal again (the log says what is missing)"


def finished(handed: list[HandedOut], timeout_s: float) -> list[HandedOut]:
    """Those that are over, after waiting ``timeout_s`` at most for the first."""
    until = time.monotonic() + timeout_s
    while not (over := [each for each in handed if each.is_over]) and time.monotonic() < until:
        time.sleep(LOOK_S)
    return over


def _import_once() -> None:
    """Workers are forked from one process that has imported what they need, and nothing else.

    Each would import it anew otherwise, also after a crash; they share the memory, too. Only on Linux:
    elsewhere the system's own libraries do not survive a fork.
    """
    from dask.config import set as configure
    from distributed.utils import get_mp_context

    configure(_FORKED)
    get_mp_context().set_forkserver_preload(IMPORTED_ONCE)
