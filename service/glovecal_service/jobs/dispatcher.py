"""A thread that claims queued jobs and runs them; the process around it may be a server or one command."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Mapping

from glovecal_models.errors import GlovecalError
from glovecal_service.jobs.finished_tasks import FinishedTasks
from glovecal_service.jobs.job_kind import JobKind
from glovecal_service.jobs.job_run import JobRun
from glovecal_service.jobs.owner import Owner
from glovecal_service.jobs.worker_entrance import WorkerEntrance
from glovecal_service.jobs.workers import Workers
from glovecal_service.settings import Settings
from glovecal_service.store import Store
from glovecal_service.store.records import JobRecord

_log = logging.getLogger("glovecal.jobs")

POLL_S = 0.2
JOBS_AT_ONCE = 2


class Dispatcher:
    """``start()`` once, ``stop()`` once; both return soon. Also a context manager."""

    def __init__(
        self,
        store: Store,
        settings: Settings,
        kinds: Callable[[], Mapping[str, JobKind]],
        *,
        of_one_command: bool = False,
    ) -> None:
        """``of_one_command``: this process has nothing to do but wait for a job, so that it runs a job's only
        task itself and starts no workers for it."""
        if of_one_command and not settings.workers:
            settings = settings.model_copy(update={"workers": 1})  # nobody else could come
        self.workers = Workers(settings)
        self._entrance = None
        if settings.site_file is not None and not of_one_command:
            self._entrance = WorkerEntrance(settings, self.workers)
        self._runs_single_tasks = of_one_command
        self._store = store
        self._folder = settings.fits_folder
        self._owners = settings.data / "owners"
        self._kinds = kinds
        self._workers_idle_s = settings.workers_idle_s
        self._busy_at = time.monotonic()
        self._owner: Owner | None = None
        self._runs: dict[threading.Thread, JobRun] = {}
        self._wake = threading.Event()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._loop, name="job-dispatcher", daemon=True)

    def start(self) -> None:
        """Take back the jobs of a killed predecessor and begin to claim."""
        self._owner = Owner(self._owners)
        self._owner.take_back_from_dead(self._store)
        FinishedTasks(self._folder).prune()
        if self._entrance is not None:
            self._entrance.start()
        self._thread.start()

    def wake(self) -> None:
        """A job was created: look now instead of within the next fifth of a second."""
        self._wake.set()

    def stop(self, timeout_s: float = 20.0) -> None:
        """Stop the fits in flight, put their jobs back into the queue, end the worker processes."""
        self._stopping.set()
        self._wake.set()
        if self._thread.ident is not None:
            self._thread.join(timeout_s)
        for thread, run in list(self._runs.items()):
            run.stop()
            thread.join(timeout_s)
        self.workers.close()
        if self._entrance is not None:
            self._entrance.stop()
        if self._owner is not None:
            self._owner.close()

    def __enter__(self) -> Dispatcher:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _loop(self) -> None:
        while not self._stopping.is_set():
            self._wake.wait(POLL_S)
            self._wake.clear()
            self._runs = {thread: run for thread, run in self._runs.items() if thread.is_alive()}
            try:
                self._end_idle_workers()
                while len(self._runs) < JOBS_AT_ONCE and not self._stopping.is_set():
                    if (job := self._store.jobs.claim(self._name())) is None:
                        break
                    self._begin(job)
            except GlovecalError as error:
                _log.warning("no job can be claimed now: %s", error)
                self._stopping.wait(1.0)
            except Exception:
                _log.exception("no job can be claimed now")
                self._stopping.wait(1.0)

    def _end_idle_workers(self) -> None:
        """Processes and ports that no job needs are closed; only this thread begins jobs."""
        now = time.monotonic()
        if self._runs or (self._entrance is not None and self._entrance.has_guests):
            self._busy_at = now
        elif self.workers.started and now - self._busy_at > self._workers_idle_s:
            self.workers.reset()

    def _begin(self, job: JobRecord) -> None:
        kinds = self._kinds()
        kind = kinds.get(job.kind)
        if kind is None:
            known = ", ".join(sorted(kinds))
            self._store.jobs.fail(job.id, job.attempt, f"no job of kind {job.kind!r}; there are {known}")
            return
        run = JobRun(
            self._store, job, kind, self.workers, self._folder, runs_single_tasks=self._runs_single_tasks
        )
        thread = threading.Thread(target=run.run, name=f"job-{job.id}", daemon=True)
        self._runs[thread] = run
        thread.start()

    def _name(self) -> str:
        assert self._owner is not None
        return self._owner.name
