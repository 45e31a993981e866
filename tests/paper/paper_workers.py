"""Jobs worked off by processes, longest first, with progress of all that run."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from multiprocessing import get_context
from queue import Empty
from typing import Any

from paper_job import PaperJob, PaperResult, run_job

from glovecal_models.threads import begin_worker

LOOK_S = 0.5
LOG_EVERY_S = 20.0

_told: Any = None
"""Of a worker: the queue to the parent, (job, sentence, fraction)."""


def work_off(
    jobs: Sequence[PaperJob], seed: int, quick: bool, workers: int, keep: Callable[[PaperResult], None]
) -> list[str]:
    """Run all jobs and ``keep`` each result at once; the names of those that failed, already reported."""
    if not jobs:
        return []
    context = get_context("spawn")
    told = context.Queue()
    progress, failed = _Progress(len(jobs)), []
    with ProcessPoolExecutor(workers, context, _start_worker, (told,)) as pool:
        running: dict[Future[PaperResult], PaperJob] = {}
        waiting = list(jobs)
        while waiting or running:
            while waiting and len(running) < workers:  # no more, so that Ctrl-C has little to wait for
                job = waiting.pop(0)
                running[pool.submit(_run, job, seed, quick)] = job
            for future in wait(running, LOOK_S, FIRST_COMPLETED).done:
                job, problem = running.pop(future), future.exception()
                if problem is None:
                    keep(future.result())
                    progress.done(job.name, f"took {future.result().took_s:.0f} s")
                else:
                    failed.append(job.name)
                    progress.done(job.name, f"failed: {type(problem).__name__}: {problem}")
            progress.show(_latest(told))
    return failed


def _start_worker(told: Any) -> None:
    global _told
    _told = told
    begin_worker()


def _run(job: PaperJob, seed: int, quick: bool) -> PaperResult:
    _told.put((job.name, "begins", 0.0))
    return run_job(job, seed, quick, lambda sentence, share: _told.put((job.name, sentence, share)))


def _latest(told: Any) -> dict[str, tuple[str, float]]:
    """What each job said last."""
    said: dict[str, tuple[str, float]] = {}
    while True:
        try:
            job, sentence, share = told.get_nowait()
        except Empty:
            return said
        said[job] = (sentence, share)


class _Progress:
    """One line on a terminal; now and then a line in a log."""

    def __init__(self, total: int) -> None:
        self._total, self._finished = total, 0
        self._now: dict[str, tuple[str, float]] = {}
        self._over: set[str] = set()
        self._shown_s, self._is_terminal = 0.0, sys.stderr.isatty()

    def show(self, said: dict[str, tuple[str, float]]) -> None:
        begun = [job for job in said if job not in self._now]
        self._now |= {job: what for job, what in said.items() if job not in self._over}
        every_s = LOOK_S if self._is_terminal else LOG_EVERY_S
        if not self._now or (time.monotonic() - self._shown_s < every_s and not begun):
            return
        self._shown_s = time.monotonic()
        each = [f"{job} {100 * share:.0f} % ({sentence})" for job, (sentence, share) in self._now.items()]
        self._say(f"{self._finished} of {self._total} done; {'; '.join(each)}", is_last=False)

    def done(self, job: str, how: str) -> None:
        self._finished += 1
        self._over.add(job)
        self._now.pop(job, None)
        self._say(f"{job}: {how}", is_last=True)

    def _say(self, text: str, *, is_last: bool) -> None:
        if self._is_terminal:
            width = os.get_terminal_size(sys.stderr.fileno()).columns - 1
            print(f"\r{text[:width]:<{width}}", end="\n" if is_last else "", file=sys.stderr, flush=True)
        else:
            print(text, file=sys.stderr, flush=True)
