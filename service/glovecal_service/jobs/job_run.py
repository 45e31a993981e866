"""One claimed job, from its plan to its last write. All writes carry the attempt number."""

from __future__ import annotations

import logging
import threading
import time
import traceback
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from glovecal_models.errors import Cancelled, GlovecalError
from glovecal_service.jobs.finished_tasks import FinishedTasks
from glovecal_service.jobs.job_kind import JobKind, JobPlan, Task, TaskReport, TaskResult
from glovecal_service.jobs.task_run import TaskOutcome, mistake, run_task
from glovecal_service.jobs.time_left import TimeLeft
from glovecal_service.jobs.workers import HandedOut, Workers, WorkersLost, finished
from glovecal_service.logs import Word
from glovecal_service.operating_system import step_back_in_this_thread
from glovecal_service.store import Store
from glovecal_service.store.errors import Conflict, StoreUnavailable
from glovecal_service.store.records import JobRecord

_log = logging.getLogger("glovecal.jobs")

WATCH_S = 0.2
HEARTBEAT_S = 5.0
MOST_BYTES_OUT = 256_000_000
"""Of one job's tasks with workers or on their way: this process has them in memory until they are done."""
WORKER_RESTARTS = 3
"""In a row: a job that gets on between two losses, as a long one on a busy computer does, may go on."""
RETRY_WRITES_FOR_S = 60.0


@dataclass(frozen=True)
class TaskProgress:
    """What a running task said last."""

    sentence: str
    share: float
    """Of this task, 0 to 1."""
    detail: Mapping[str, Any]


class TaskFailed(GlovecalError):
    """What a task's outcome says, with the traceback of an error that nobody foresaw."""

    def __init__(self, sentence: str, trace: str | None) -> None:
        super().__init__(sentence)
        self.trace = trace


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
        self._telling = threading.Lock()
        self._tasks: Sequence[Task] = ()
        self._done: set[int] = set()
        self._reported: dict[int, TaskProgress] = {}
        """Written by whoever runs a task."""
        self._noticed: dict[int, TaskProgress] = {}
        self._time_left: TimeLeft | None = None
        self._absence: str | None = None
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
        except TaskFailed as error:
            message, trace = str(error), error.trace
        except GlovecalError as error:
            message = str(error)
        except Exception as error:
            message, trace = mistake(error), traceback.format_exc()
        if trace is not None:
            _log.error("job %s (%s) failed: %s", id, Word(self._job.kind), trace)
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
        return run_task(task, self._stopped.is_set, self._report(number))

    def _report(self, number: int) -> TaskReport:
        def report(sentence: str, share: float, detail: Mapping[str, Any] = MappingProxyType({}), /) -> None:
            self._reported[number] = TaskProgress(sentence, min(max(float(share), 0.0), 1.0), detail)

        return report

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
        """Keep every worker busy with one task and one waiting."""
        waiting = [number for number in range(len(plan.tasks)) if number not in results]
        running: dict[HandedOut, int] = {}
        if waiting and not self._workers.started:
            self._progress(self._fraction(), "starting the training processes", {})
        try:
            while waiting or running:
                self._raise_if_stopped()
                while waiting and self._may_hand_out(running):
                    number = waiting.pop(0)
                    running[self._workers.submit(plan.tasks[number], self._report(number))] = number
                    self._begin_to_count()
                self._workers.check()
                self._tell_absence()
                for handed in finished(list(running), WATCH_S):
                    self._take(plan, running.pop(handed), handed.outcome, results)
        finally:
            for handed in running:
                handed.drop()

    def _tell_absence(self) -> None:
        """Say once that nobody works, and once that somebody does again."""
        absence = self._workers.absence
        if absence != self._absence:
            self._absence = absence
            self._progress(self._fraction(), absence or "a worker is there: training", {})

    def _may_hand_out(self, running: Collection[HandedOut]) -> bool:
        if len(running) >= 2 * self._workers.count:
            return False
        return not running or sum(handed.weight for handed in running) < MOST_BYTES_OUT

    def _take(self, plan: JobPlan, number: int, outcome: TaskOutcome, results: dict[int, TaskResult]) -> None:
        if outcome.cancelled:
            raise Cancelled("the fit was stopped")
        if outcome.error is not None:
            raise TaskFailed(outcome.error, outcome.trace)
        results[number] = TaskResult.from_bytes(outcome.result)
        self._finished.put(plan.tasks[number].key, results[number])
        step = plan.step(number, results)
        with self._telling:
            self._done.add(number)
            self._noticed.pop(number, None)
        self._progress(self._fraction(), step.sentence, step.detail)

    def _fraction(self) -> float:
        """Of all tasks' efforts, what is done and what running tasks have said of themselves."""
        effort = [1.0 if task.effort is None else task.effort for task in self._tasks]
        running = sum(effort[number] * progress.share for number, progress in self._noticed.items())
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
        """Pass on what a running task said last, once."""
        with self._telling:
            told = None
            for number, progress in list(self._reported.items()):
                if number not in self._done and progress != self._noticed.get(number):
                    self._noticed[number] = told = progress
            if told is not None and not self._stopped.is_set():
                self._tell(self._fraction(), told.sentence, dict(told.detail))

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

    def _raise_if_stopped(self) -> None:
        if self._stopped.is_set():
            raise Cancelled("the job was stopped")
