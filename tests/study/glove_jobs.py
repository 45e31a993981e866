"""Gloves worked off by two processes, one glove one job, with progress and the time that is left."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from multiprocessing import get_context
from typing import Any, Protocol

from blind_glove import BlindGlove
from finished_gloves import FinishedGloves

from glovecal_models.improvement.limits import ImprovementLimits
from glovecal_models.threads import begin_worker

WORKERS = 2
Answer = Callable[[BlindGlove], dict[str, Any]]
"""Of one glove, by the limits that were chosen."""
Row = tuple[BlindGlove, dict[str, Any]]


class Job(Protocol):
    """What is asked of a glove."""

    def __call__(self, glove: BlindGlove, limits: ImprovementLimits) -> dict[str, Any]: ...


def answers(
    gloves: Sequence[BlindGlove],
    job: Answer,
    finished: FinishedGloves,
    label: str,
    workers: int = WORKERS,
    until: float = math.inf,
) -> list[Row]:
    """The job's answer for every glove, in order. A job that fails is reported and left out.

    ``until``: the time (``time.monotonic``) from which on no further glove is asked; those that are being
    asked are waited for.
    """
    waiting = [glove for glove in gloves if finished.get(glove.key) is None]
    if time.monotonic() >= until:
        waiting.clear()
    known = sum(finished.get(glove.key) is not None for glove in gloves)
    progress = _Progress(label, len(gloves), known)
    if waiting:
        with ProcessPoolExecutor(workers, get_context("spawn"), begin_worker) as pool:
            running: dict[Future[tuple[dict[str, Any], float]], BlindGlove] = {}
            while waiting or running:
                if time.monotonic() >= until:
                    waiting.clear()
                while waiting and len(running) <= workers:  # few, so that Ctrl-C has little to wait for
                    glove = waiting.pop(0)
                    running[pool.submit(_timed, job, glove)] = glove
                if not running:
                    break
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    glove = running.pop(future)
                    _keep(future, glove, finished)
                    progress.step(f"{glove.truth} {glove.number}")
    progress.end()
    return [(glove, answer) for glove in gloves if (answer := finished.get(glove.key)) is not None]


def _timed(job: Answer, glove: BlindGlove) -> tuple[dict[str, Any], float]:
    """The answer, and the seconds of processor time that it took."""
    begin = time.process_time()
    return job(glove), time.process_time() - begin


def _keep(future: Future[tuple[dict[str, Any], float]], glove: BlindGlove, finished: FinishedGloves) -> None:
    problem = future.exception()
    if problem is None:
        finished.keep(glove.key, *future.result())
    else:
        print(
            f"\n{glove.part}: glove {glove.truth} {glove.number} (seed {glove.seed}) failed: "
            f"{type(problem).__name__}: {problem}",
            file=sys.stderr,
        )


class _Progress:
    """One line on a terminal; now and then a line in a log."""

    def __init__(self, label: str, total: int, done: int) -> None:
        self._label, self._total, self._done, self._before = label, total, done, done
        self._start = self._shown = time.monotonic()

    def step(self, what: str) -> None:
        self._done += 1
        now = time.monotonic()
        every_s = 0.5 if sys.stderr.isatty() else 20.0
        if now - self._shown < every_s:
            return
        self._shown = now
        left_s = (now - self._start) / (self._done - self._before) * (self._total - self._done)
        text = f"{self._label}: {self._done} of {self._total} gloves, about {_time(left_s)} left ({what})"
        print(f"\r{text:<90}" if sys.stderr.isatty() else text, end="" if sys.stderr.isatty() else "\n",
              file=sys.stderr, flush=True)  # fmt: skip

    def end(self) -> None:
        took = _time(time.monotonic() - self._start)
        text = (
            f"{self._label}: {self._done} of {self._total} gloves, {self._before} known before, took {took}"
        )
        print(f"\r{text:<90}" if sys.stderr.isatty() else text, file=sys.stderr, flush=True)


def _time(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"
