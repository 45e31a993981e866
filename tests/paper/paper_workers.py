"""Jobs worked off by processes, longest first, with progress of all that run."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

from paper_job import PaperJob, PaperResult, run_job

from glovecal_models.worker_processes import work_off as work_off_tasks

EVERY_S = 20.0
"""How often a job that runs says how far it is."""


def work_off(
    jobs: Sequence[PaperJob], seed: int, quick: bool, workers: int, keep: Callable[[PaperResult], None]
) -> list[str]:
    """Run all jobs and ``keep`` each result at once; the names of those that failed, already reported."""
    failed = []

    def take(number: int, result: PaperResult | str) -> None:
        name = jobs[number].name
        if isinstance(result, str):
            failed.append(name)
            _say(f"{name}: failed: {result}")
        else:
            keep(result)
            _say(f"{name}: took {result.took_s:.0f} s")

    work_off_tasks(partial(_run, seed=seed, quick=quick), jobs, workers, take, "the paper's figures")
    return failed


def _run(job: PaperJob, seed: int, quick: bool) -> PaperResult | str:
    _say(f"{job.name}: begins")
    try:
        return run_job(job, seed, quick, _Progress(job.name))
    except Exception as error:
        return f"{type(error).__name__}: {error}"


@dataclass
class _Progress:
    """A line now and then, on standard error, by the process that works on the job."""

    job: str
    said_s: float = field(default_factory=time.monotonic)

    def __call__(self, sentence: str, share: float) -> None:
        if time.monotonic() - self.said_s > EVERY_S:
            self.said_s = time.monotonic()
            _say(f"{self.job}: {100 * share:.0f} % ({sentence})")


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
