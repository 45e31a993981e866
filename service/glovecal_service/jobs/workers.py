"""The worker processes, started when the first task needs them.

Dask distributed was chosen over procrastinate (needs PostgreSQL) and Ray (620 MB, 24 s to start): it starts
in 2 s with SQLite alone, retries a task whose worker died, and a scheduler elsewhere is one setting. It is
trusted with nothing but running: the database remembers jobs, the fits folder remembers results. It is
imported at the first task too: importing it takes a second that short commands do not have.

Dask's processes run what they are sent, so they speak TLS and both sides have to show a certificate. That of
our own processes is made at their start and signs itself; its key is in their memory alone, so that no other
user of this computer can have it.
"""

from __future__ import annotations

import asyncio
import logging
import os
import subprocess
import sys
import tempfile
import threading
import time
from concurrent.futures import CancelledError
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, cast

from glovecal_client.encryption.kept_file import is_encrypting
from glovecal_client.errors import reason_of
from glovecal_models.errors import GlovecalError
from glovecal_service.jobs.dask_log import silence_dask
from glovecal_service.jobs.job_kind import Task
from glovecal_service.jobs.task_run import TaskOutcome, run_task
from glovecal_service.operating_system import FORKS
from glovecal_service.settings import Settings

if TYPE_CHECKING:
    from distributed import Client, Future, LocalCluster, Security

_log = logging.getLogger("glovecal.jobs")

START_TIMEOUT_S = 60
LOOK_S = 0.01
LONGEST_ABSENCE_S = 45.0
FETCH_WITHIN_S = 30.0
"""A finished task's answer is a few hundred bytes."""
CANCELLED = (asyncio.CancelledError, CancelledError)
_CONFIG = {
    "distributed.admin.large-graph-warning-threshold": "1GB",
    "distributed.scheduler.allowed-failures": 2,
    "distributed.comm.timeouts.connect": "30s",
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
    # Dask has every array above 128 kB mapped anew, which costs a diagnosis as much as its arithmetic. glibc
    # takes no more than 32 MiB for the second.
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 256 << 20,
    "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": 32 << 20,
}
_FORKED = {"distributed.worker.multiprocessing-method": "forkserver"}
_NOTHING_SPILLED = {"distributed.worker.memory.target": False, "distributed.worker.memory.spill": False}
"""What fills a worker's memory does not go to the disk, where it would lie as it is."""
_LONGEST_FOLDER = 75
"""Bytes: the name of a socket in the folder for temporary files has to fit into 107."""
_IMPORTED_ONCE = ["distributed", "distributed.nanny", "scipy.signal", "glovecal_service.questions.catalogue"]
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


class Workers:
    """A Dask client that comes to life at the first ``submit``. Safe to use from several threads."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._lock = threading.Lock()
        self._client: Client | None = None
        self._cluster: LocalCluster | None = None
        self._absent_since: float | None = None
        self._closed = False

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
        client = self._client
        if self._settings.scheduler is None or client is None:
            return self._settings.workers
        return max(1, sum(cast(dict[str, int], client.nthreads()).values()))

    def submit(self, task: Task, folder: Path, cancel_file: Path, progress_file: Path) -> Future:
        """Hand a task out. Raises WorkersLost."""
        from distributed.client import ClosedClientError

        client = None
        try:
            client = self._started()
            return client.submit(run_task, task, folder, cancel_file, progress_file, pure=False)
        except (OSError, TimeoutError, RuntimeError, ClosedClientError) as error:
            raise WorkersLost("the training processes cannot be reached", client) from error

    def check(self) -> None:
        """Raise WorkersLost when every process of our own has been gone for long.

        Dask starts a killed process again, but gives up when that takes too long on a busy computer; tasks
        would then wait for ever.
        """
        client, cluster = self._client, self._cluster
        scheduler = None if cluster is None else cluster.scheduler
        if client is None or scheduler is None or scheduler.workers:
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
        client = self._client
        return [] if client is None else list(cast(dict[str, int], client.run(_pid)).values())

    def _started(self) -> Client:
        from dask.config import set as configure
        from distributed import Client

        silence_dask()
        with self._lock:
            if self._closed:
                raise WorkersLost("the service is stopping")
            if self._client is None:
                configure(_CONFIG | _NOTHING_SPILLED if is_encrypting() else _CONFIG)
                if FORKS and len(os.fsencode(tempfile.gettempdir())) <= _LONGEST_FOLDER:
                    _import_once()
                try:
                    security = _security(self._settings)
                    address = self._settings.scheduler or self._local_cluster(security)
                    self._client = Client(
                        address, security=security, timeout=START_TIMEOUT_S, set_as_default=False
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
        return self._cluster

    def _close(self) -> None:
        client, self._client = self._client, None
        cluster, self._cluster = self._cluster, None
        self._absent_since = None
        for part, timeout_s in ((client, 5), (cluster, 10)):
            with suppress(TimeoutError, OSError):  # it is thrown away in any case
                if part is not None:
                    part.close(timeout=timeout_s)


def _security(settings: Settings) -> Security:
    """Who may speak to the scheduler and the workers."""
    from distributed import Security

    if settings.scheduler is None:
        return Security.temporary()
    certificate, key = str(settings.scheduler_certificate), str(settings.scheduler_key)
    return Security(
        require_encryption=True,
        tls_ca_file=str(settings.scheduler_ca),
        tls_client_cert=certificate,
        tls_client_key=key,
    )


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
    command = [sys.executable, "-P", "-c", "import " + ", ".join(_IMPORTED_ONCE)]
    child = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    if child.returncode == 0:
        return "each ends while it starts; the service's log says more"
    _log.warning("what a training process imports: %s", child.stderr.strip())
    return "none can import what it needs; install Glovecal again (the log says what is missing)"


LOOP_IS_CLOSED = "IOLoop is closed"
"""What Dask says of a client that was closed between the announcement of a result and its fetching."""


def finished(futures: list[Future], timeout_s: float) -> list[Future]:
    """Those that are finished, after waiting ``timeout_s`` at most for the first.

    Looks instead of calling Dask's ``wait``, which wants one client for the whole process.
    """
    until = time.monotonic() + timeout_s
    while not (done := [future for future in futures if future.done()]) and time.monotonic() < until:
        time.sleep(LOOK_S)
    return done


def outcome(future: Future, task: Task) -> TaskOutcome:
    """What became of a finished future. Raises WorkersLost, TaskKilledWorkers."""
    from distributed import KilledWorker
    from distributed.client import ClosedClientError

    try:
        # a result can go with its process after it was announced; without a limit this would wait for ever
        return future.result(timeout=FETCH_WITHIN_S)
    except (*CANCELLED, OSError, TimeoutError, ClosedClientError) as error:
        raise WorkersLost("the scheduler of the training processes was lost", future.client) from error
    except RuntimeError as error:
        if LOOP_IS_CLOSED not in str(error):  # a task's own error
            raise
        raise WorkersLost("another job has replaced the training processes", future.client) from error
    except KilledWorker as error:
        raise TaskKilledWorkers(
            f"{task.label}: every process that worked on it died (killed, or out of memory)"
        ) from error


def _import_once() -> None:
    """Workers are forked from one process that has imported what they need, and nothing else.

    Each would import it anew otherwise, also after a crash; they share the memory, too. Only on Linux:
    elsewhere the system's own libraries do not survive a fork.
    """
    from dask.config import set as configure
    from distributed.utils import get_mp_context

    configure(_FORKED)
    get_mp_context().set_forkserver_preload(_IMPORTED_ONCE)


def _pid() -> int:
    return os.getpid()
