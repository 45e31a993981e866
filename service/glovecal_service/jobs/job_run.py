"""One claimed job, from its plan to its last write. All writes carry the attempt number."""

from __future__ import annotations

import logging
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from glovecal_client.operating_system import remove
from glovecal_models.errors import Cancelled, GlovecalError
from glovecal_service.jobs.finished_tasks import FinishedTasks
from glovecal_service.jobs.job_kind import JobKind, JobPlan, Task, TaskResult
from glovecal_service.jobs.progress_file import ProgressFile, TaskProgress
from glovecal_service.jobs.task_run import TaskOutcome, run_task
from glovecal_service.jobs.time_left import TimeLeft
from glovecal_service.jobs.workers import Workers, WorkersLost, finished, outcome
from glovecal_service.logs import Word
from glovecal_service.operating_system import step_back_in_this_thread
from glovecal_service.store import Store
from glovecal_service.store.errors import Conflict, StoreUnavailable
from glovecal_service.store.records import JobRecord

if TYPE_CHECKING:
    from distributed import Future

_log = logging.getLogger("glovecal.jobs")

WATCH_S = 0.2
HEARTBEAT_S = 5.0
STRAGGLERS_S = 1.0
"""After a cancel the row is written this late at most, whether or not the last fit has noticed."""
WORKER_RESTARTS = 3
"""In a row: a job that gets on between two losses, as a long one on a busy computer does, may go on."""
RETRY_WRITES_FOR_S = 60.0


class JobRun:
    """Runs in a thread of its own; a second thread keeps the lease and watches for the cancel request."""

    def __init__(
        self,
        store: Store,
        job: JobRecord,
        kind: JobKind,
        workers: Workers,
        folder: Path,
        *,
        runs_single_tasks: bool = False,
    ) -> None:
        """``runs_single_tasks``: a single task that is left to do runs in this process."""
        self._runs_single_tasks = runs_single_tasks
        self._store = store
        self._job = job
        self._kind = kind
        self._workers = workers
        self._finished = FinishedTasks(folder)
        self._cancel_file = folder / f"cancel-{job.id}-{job.attempt}"
        self._folder = folder
        self._telling = threading.Lock()
        self._tasks: Sequence[Task] = ()
        self._done: set[int] = set()
        self._heard: dict[int, TaskProgress] = {}
        self._time_left: TimeLeft | None = None
        self._ended = threading.Event()
        self._stopped = threading.Event()
        self._released = False

    def stop(self) -> None:
        """The service stops: leave the job to the next start."""
        self._released = True
        self._cancel()

    def run(self) -> None:
        """Never raises; whatever happens is written to the job's row or to the log."""
        watch = threading.Thread(target=self._watch, name=f"watch-{self._job.id}", daemon=True)
        watch.start()
        try:
            self._written(self._end())
        except Conflict as error:
            _log.warning("job %s was taken over: %s", self._job.id, error)
        except GlovecalError as error:
            _log.error("job %s could not be ended: %s", self._job.id, error)
        finally:
            self._ended.set()
            watch.join()
            remove(self._cancel_file)
            for number in range(len(self._tasks)):
                remove(self._progress_file(number))

    def _end(self) -> Callable[[], object]:
        """Do the work; the write that ends it."""
        jobs, id, attempt = self._store.jobs, self._job.id, self._job.attempt
        trace = None
        try:
            result = self._result()
            return lambda: jobs.finish(id, attempt, result)
        except Cancelled:
            if self._released:
                return lambda: jobs.release(id, attempt)
            return lambda: jobs.cancelled(id, attempt)
        except Conflict as error:
            if self._is_over():
                raise
            message = str(error)
        except GlovecalError as error:
            message = str(error)
        except Exception as error:
            trace = traceback.format_exc()
            _log.exception("job %s (%s) failed", id, Word(self._job.kind))
            message = f"an error in Glovecal itself ({type(error).__name__}): the job's traceback tells where"
        return lambda: jobs.fail(id, attempt, message, trace)

    def _result(self) -> dict:
        plan = self._kind.plan(self._store, self._job)
        results = self._known(plan)
        is_single = self._runs_single_tasks and len(plan.tasks) - len(results) <= 1
        if is_single and not plan.in_this_process:
            step_back_in_this_thread()  # this thread ends with the job
        if plan.in_this_process or is_single:
            self._fit_here(plan, results)
        else:
            self._fit_in_workers(plan, results)
        self._raise_if_stopped()
        self._progress(1.0, "putting the result together", {})
        return plan.finish([results[number] for number in range(len(plan.tasks))])

    def _known(self, plan: JobPlan) -> dict[int, TaskResult]:
        """Results that an earlier attempt or an earlier job left."""
        found = {number: self._finished.get(task.key) for number, task in enumerate(plan.tasks)}
        results = {number: result for number, result in found.items() if result is not None}
        with self._telling:
            self._tasks, self._done = plan.tasks, set(results)
        already = f", {len(results)} of them known already" if results else ""
        self._progress(
            self._fraction(),
            f"{len(plan.tasks)} fits to do{already}",
            {"tasks": len(plan.tasks), "known": len(results)},
        )
        return results

    def _fit_here(self, plan: JobPlan, results: dict[int, TaskResult]) -> None:
        for number, task in enumerate(plan.tasks):
            self._raise_if_stopped()
            if number not in results:
                self._take(plan, number, self._run_here(number, task), results)

    def _run_here(self, number: int, task: Task) -> TaskOutcome:
        self._begin_to_count()
        return run_task(task, self._finished.folder, self._cancel_file, self._progress_file(number))

    def _progress_file(self, number: int) -> Path:
        return self._folder / f"progress-{self._job.id}-{self._job.attempt}-{number}.json"

    def _fit_in_workers(self, plan: JobPlan, results: dict[int, TaskResult]) -> None:
        restarts = 0
        while True:
            known = len(results)
            try:
                self._hand_out(plan, results)
                return
            except WorkersLost as error:
                self._raise_if_stopped()
                restarts = 1 if len(results) > known else restarts + 1
                if restarts > WORKER_RESTARTS:
                    raise
                _log.warning("job %s: training processes lost, starting again: %s", self._job.id, error)
                self._workers.reset(error.client)

    def _hand_out(self, plan: JobPlan, results: dict[int, TaskResult]) -> None:
        """Keep every worker busy with one task and one waiting; futures are dropped as they finish."""
        waiting = [number for number in range(len(plan.tasks)) if number not in results]
        running: dict[Future, int] = {}
        if waiting and not self._workers.started:
            self._progress(self._fraction(), "starting the training processes", {})
        try:
            while waiting or running:
                self._raise_if_stopped()
                while waiting and len(running) < 2 * self._workers.count:
                    number = waiting.pop(0)
                    task = plan.tasks[number]
                    files = self._finished.folder, self._cancel_file, self._progress_file(number)
                    future = self._workers.submit(task, *files)
                    running[future] = number
                    self._begin_to_count()
                self._workers.check()
                for future in finished(list(running), WATCH_S):
                    number = running.pop(future)
                    self._take(plan, number, self._outcome(future, plan.tasks[number]), results)
        except WorkersLost:
            raise
        except BaseException:
            self._leave(list(running))
            raise

    def _outcome(self, future: Future, task: Task) -> TaskOutcome:
        """Of a finished future. An answer that is lost, or late on a busy computer, is not missed where the
        task's result is on disk. Raises as ``outcome``.
        """
        try:
            return outcome(future, task)
        except WorkersLost:
            if self._finished.get(task.key) is None:
                raise
            return TaskOutcome(task.key, 0.0)

    def _leave(self, running: list[Future]) -> None:
        """An error or a cancel: the fits in flight are told to stop, and given a moment to do so."""
        self._cancel()
        until = time.monotonic() + STRAGGLERS_S
        while running and (left := until - time.monotonic()) > 0:
            done = finished(running, left)
            running = [future for future in running if future not in done]

    def _take(self, plan: JobPlan, number: int, outcome: TaskOutcome, results: dict[int, TaskResult]) -> None:
        if outcome.cancelled:
            raise Cancelled("the fit was stopped")
        if outcome.error is not None:
            raise GlovecalError(outcome.error)
        result = self._finished.get(outcome.key)
        if result is None:
            raise WorkersLost(f"the result of {plan.tasks[number].label} is not in {self._finished.folder}")
        results[number] = result
        step = plan.step(number, results)
        with self._telling:
            self._done.add(number)
            self._heard.pop(number, None)
        self._progress(self._fraction(), step.sentence, step.detail)

    def _fraction(self) -> float:
        """Of all tasks' efforts, what is done and what running tasks have said of themselves."""
        effort = [1.0 if task.effort is None else task.effort for task in self._tasks]
        running = sum(effort[number] * said.share for number, said in self._heard.items())
        return (sum(effort[number] for number in self._done) + running) / max(sum(effort), 1e-9)

    def _begin_to_count(self) -> None:
        """Once the first task runs, and only where all efforts are known."""
        if self._time_left is None and all(task.effort is not None for task in self._tasks):
            self._time_left = TimeLeft(self._fraction())

    def _progress(self, fraction: float, sentence: str, detail: dict) -> None:
        with self._telling:
            self._written(lambda: self._tell(fraction, sentence, detail))

    def _tell(self, fraction: float, sentence: str, detail: dict) -> None:
        left = None if self._time_left is None else self._time_left.seconds(fraction)
        if left is not None:
            detail = detail | {"seconds_left": round(left, 1)}
        self._store.jobs.progress(self._job.id, self._job.attempt, fraction, sentence, detail)

    def _tell_on(self) -> None:
        """Pass on what a running task said last, once; its file is gone before its own end is told."""
        with self._telling:
            told = None
            for number in set(range(len(self._tasks))) - self._done:
                said = ProgressFile(self._progress_file(number)).read()
                if said is not None and said != self._heard.get(number):
                    self._heard[number] = told = said
            if told is not None and not self._stopped.is_set():
                self._tell(self._fraction(), told.sentence, told.detail)

    def _written(self, write: Callable[[], object]) -> None:
        """Repeat a write while the database is away; the lease outlives a short restart."""
        until = time.monotonic() + RETRY_WRITES_FOR_S
        while True:
            try:
                write()
                return
            except StoreUnavailable:
                if time.monotonic() > until:
                    raise
                time.sleep(WATCH_S)

    def _watch(self) -> None:
        beat = time.monotonic()
        while not self._ended.wait(WATCH_S):
            try:
                if time.monotonic() - beat >= HEARTBEAT_S:
                    beat = time.monotonic()
                    self._store.jobs.heartbeat(self._job.id, self._job.attempt)
                self._tell_on()
                if self._store.jobs.get(self._job.id).cancel_requested:
                    self._cancel()
            except StoreUnavailable as error:
                _log.warning("job %s cannot be watched now: %s", self._job.id, error)
            except GlovecalError:
                self._cancel()  # the attempt is over: somebody else runs the job

    def _is_over(self) -> bool:
        record = self._store.jobs.get(self._job.id)
        return record.state != "running" or record.attempt != self._job.attempt

    def _cancel(self) -> None:
        self._stopped.set()
        if not self._ended.is_set():
            self._cancel_file.touch()

    def _raise_if_stopped(self) -> None:
        if self._stopped.is_set():
            raise Cancelled("the job was stopped")
