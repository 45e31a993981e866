"""Runs one task, in a worker process or in this one: what it needs comes with it, what it found goes back."""

from __future__ import annotations

import traceback
from dataclasses import dataclass

from glovecal_models.errors import Cancelled, GlovecalError
from glovecal_models.progress import Cancel
from glovecal_service.jobs.job_kind import Task, TaskReport


@dataclass(frozen=True)
class TaskOutcome:
    """What became of a task."""

    result: bytes = b""
    """As ``TaskResult.to_bytes`` has it, where there is neither an error nor a cancel."""
    error: str | None = None
    """For a person."""
    trace: str | None = None
    """Of an error that nobody foresaw."""
    cancelled: bool = False


def run_task(task: Task, cancelled: Cancel, report: TaskReport) -> TaskOutcome:
    """Never raises: an error of a task is its outcome, and whoever ran it goes on."""
    try:
        if cancelled():
            raise Cancelled("stopped before it began")
        return TaskOutcome(task.function(task.payload, cancelled, report).to_bytes())
    except Cancelled:
        return TaskOutcome(cancelled=True)
    except GlovecalError as error:
        return TaskOutcome(error=f"{task.label}: {error}")
    except MemoryError:
        return TaskOutcome(
            error=f"{task.label}: there is too little memory; run fewer workers, or fewer takes"
        )
    except Exception as error:
        return TaskOutcome(error=mistake(error), trace=traceback.format_exc())


def mistake(error: Exception) -> str:
    """What a person is told of an error that nobody foresaw."""
    return f"an error in Glovecal itself ({type(error).__name__}): the job's traceback tells where"
