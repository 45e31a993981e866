"""Waiting with a progress bar on a terminal: for a job, for some seconds, for work in this process, which
writes lines into a file."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rich.progress import BarColumn, Progress, Task, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.text import Text

from glovecal_client.errors import ServiceError
from glovecal_models.progress import Report
from glovecal_service.cli.terminal.printing import Refusal, err
from glovecal_service.jobs.time_left import TimeLeft
from glovecal_service.plain import read
from glovecal_service.rest.job.answer import Job, JobFacts

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

STEP_S = 0.1
LINE_EVERY_S = 5.0
"""Where progress goes into a file."""
BAR_WIDTH, TEXT_WIDTH = 12, 44
"""Text, bar, percentage and time fit into 80 columns."""


def begun_job(document: dict[str, Any]) -> str:
    """Its id, of what REST answers where a job is begun."""
    return read(JobFacts, document).id


def wait_for_job(service: RestClient, job: str, *, quiet: bool = False, cancel: bool = True) -> Job:
    """The finished job. Raises Refusal when it failed; Ctrl-C cancels it, if ``cancel``, and raises on."""
    with _bar(quiet) as progress:
        bar = progress.add_task("waiting for a worker", total=1.0)

        def show(document: dict[str, Any]) -> None:
            now = read(Job, document)
            progress.update(
                bar,
                completed=now.fraction,
                description=_short(now.sentence or "waiting for a worker"),
                left=now.detail.get("seconds_left"),
            )

        try:
            return read(Job, service.wait_for_job(job, progress=show))
        except (KeyboardInterrupt, SystemExit):
            if cancel:
                service.post(f"/jobs/{job}/cancel")
                err.print(f"Job {job} cancelled; finished parts are kept for the next attempt.")
            raise
        except ServiceError as error:
            if not error.title.startswith("Job "):
                raise
            reason = f": {error.detail}" if error.detail else ""
            raise Refusal(f"job {job} {error.title.removeprefix('Job ')}{reason}") from error


def wait_seconds(seconds: float, what: str, *, quiet: bool = False) -> None:
    """Let time pass, with a bar; Ctrl-C raises on."""
    until = time.monotonic() + seconds
    with _bar(quiet) as progress:
        bar = progress.add_task(what, total=seconds)
        while (left := until - time.monotonic()) > 0:
            time.sleep(min(STEP_S, left))
            progress.update(bar, completed=seconds - max(0.0, until - time.monotonic()))


@contextmanager
def progress_bar(*, quiet: bool = False) -> Iterator[Report]:
    """For work in this process: what takes a sentence and the fraction done; time left is told from it.

    Where nobody sees a bar it is a line every some seconds: "12 %: rendering; about 40 s left"."""
    with _bar(quiet) as progress:
        bar, left, said_s = progress.add_task("", total=1.0), TimeLeft(0.0), time.monotonic()

        def report(sentence: str, fraction: float) -> None:
            nonlocal said_s
            if not (quiet or err.is_terminal) and time.monotonic() - said_s >= LINE_EVERY_S:
                said_s = time.monotonic()
                seconds = left.seconds(fraction)
                more = "" if seconds is None else f"; about {max(1, round(seconds))} s left"
                err.print(f"{100 * fraction:.0f} %: {sentence}{more}")
            progress.update(
                bar, completed=fraction, description=_short(sentence), left=left.seconds(fraction)
            )

        yield report


def _short(sentence: str) -> str:
    """What fits; before a colon stands what the bar is about, after it how far that is."""
    _, colon, news = sentence.partition(": ")
    return (news if colon and len(sentence) > TEXT_WIDTH else sentence)[:TEXT_WIDTH]


def _bar(quiet: bool) -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(BAR_WIDTH), TaskProgressColumn())
    shown = err.is_terminal and not quiet
    return Progress(*columns, _TimeColumn(), console=err, transient=True, disable=not shown)


class _TimeColumn(TimeElapsedColumn):
    """The job's own estimate of the time left, else the time elapsed: rich's TimeRemainingColumn extrapolates
    from the bar, which jobs of unequal steps mislead."""

    def render(self, task: Task) -> Text:
        left = task.fields.get("left")
        if left is None:
            return super().render(task)
        return Text(f"about {max(1, round(left))} s left", style="progress.remaining")
