"""A kind of job for the tests of the dispatcher: real tasks in real processes, counted in a ledger file."""

from __future__ import annotations

import hashlib
import os
import signal
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg
from threadpoolctl import threadpool_info

from glovecal_models.errors import Cancelled, NotTrainable
from glovecal_service.jobs.job_kind import JobPlan, Step, Task, TaskReport, TaskResult
from glovecal_service.store import Store
from glovecal_service.store.records import JobRecord


@dataclass(frozen=True)
class Counting:
    """Sum the first ``number`` integers, slowly, and write down that it was done."""

    number: int
    seconds: float
    ledger: Path
    ending: str = "result"


def count(work: Counting, cancelled: Callable[[], bool], report: TaskReport) -> TaskResult:
    note(work.ledger, f"begin {work.number} {os.getpid()}")
    report(f"adding up to {work.number}", 0.0, {"number": work.number})
    until = time.monotonic() + work.seconds
    while time.monotonic() < until:
        if cancelled():
            raise Cancelled("stopped")
        time.sleep(0.005)
    if work.ending == "refuse":
        raise NotTrainable("the samples are all alike")
    if work.ending == "break":
        raise ZeroDivisionError("a mistake in the program")
    if work.ending == "network":
        raise ConnectionResetError(104, "Connection reset by peer")
    if work.ending == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    note(work.ledger, f"done {work.number} {os.getpid()}")
    scipy.linalg.cholesky(np.eye(3))
    threads = max(pool["num_threads"] for pool in threadpool_info())
    facts = {"niceness": os.nice(0), "blas_threads": threads, "pid": os.getpid()}
    return TaskResult({"sum": np.array(sum(range(work.number + 1)))}, facts)


def note(ledger: Path, line: str) -> None:
    handle = os.open(ledger, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    os.write(handle, f"{line}\n".encode())
    os.close(handle)


def noted(ledger: Path, word: str) -> list[int]:
    """The numbers written down with ``word``, in order."""
    lines = ledger.read_text().splitlines() if ledger.exists() else []
    return [int(line.split()[1]) for line in lines if line.startswith(f"{word} ")]


class CountingJob:
    """Payload: ``numbers``, ``seconds`` each, ``ledger``, ``ending``, ``here`` (in this process)."""

    def plan(self, store: Store, job: JobRecord) -> JobPlan:
        ledger = Path(job.payload["ledger"])
        ending = job.payload.get("ending", "result")
        tasks = []
        for number in job.payload["numbers"]:
            work = Counting(number, job.payload["seconds"], ledger, ending)
            key = hashlib.sha256(f"{number} {ledger}".encode()).hexdigest()
            tasks.append(Task(key, f"sum to {number}", count, work))

        def finish(results: Sequence[TaskResult]) -> dict[str, Any]:
            return {"sums": [int(r.arrays["sum"]) for r in results], "facts": [r.facts for r in results]}

        def step(number: int, results: Any) -> Step:
            return Step(f"{tasks[number].label} done", {"done": len(results)})

        return JobPlan(tasks, step, finish, in_this_process=job.payload.get("here", False))
