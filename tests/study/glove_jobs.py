"""Gloves worked off by two processes, one glove one job, with progress and the time that is left."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, Protocol

from blind_glove import BlindGlove
from finished_gloves import FinishedGloves

from glovecal_models.improvement.limits import ImprovementLimits
from glovecal_models.worker_processes import work_off

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
    known = sum(finished.get(glove.key) is not None for glove in gloves)
    progress = _Progress(label, len(gloves), known)

    def asked() -> Iterator[BlindGlove]:
        for glove in waiting:
            if time.monotonic() >= until:
                return
            yield glove

    def keep(number: int, found: tuple[dict[str, Any], float] | str) -> None:
        glove = waiting[number]
        if isinstance(found, str):
            print(
                f"\n{glove.part}: glove {glove.truth} {glove.number} (seed {glove.seed}) failed: {found}",
                file=sys.stderr,
            )
        else:
            finished.keep(glove.key, *found)
        progress.step(f"{glove.truth} {glove.number}")

    work_off(partial(_timed, job), asked(), workers, keep, label)
    progress.end()
    return [(glove, answer) for glove in gloves if (answer := finished.get(glove.key)) is not None]


def _timed(job: Answer, glove: BlindGlove) -> tuple[dict[str, Any], float] | str:
    """The answer, and the seconds of processor time that it took; the error's text where there is none."""
    begin = time.process_time()
    try:
        return job(glove), time.process_time() - begin
    except Exception as error:
        return f"{type(error).__name__}: {error}"


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
