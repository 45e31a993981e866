"""Runs one task, in a worker process or in this one, and keeps its result on disk."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

from glovecal_client.encryption.key_file import settle_encryption
from glovecal_client.errors import BadEncryptionKey
from glovecal_models.errors import Cancelled, GlovecalError
from glovecal_service.jobs.finished_tasks import FinishedTasks
from glovecal_service.jobs.job_kind import Task
from glovecal_service.jobs.progress_file import ProgressFile

CANCEL_POLL_S = 0.05


@dataclass(frozen=True)
class TaskOutcome:
    """The little that travels back; the result itself is on disk."""

    key: str
    seconds: float
    error: str | None = None
    cancelled: bool = False


def run_task(task: Task, folder: Path, cancel_file: Path, progress_file: Path) -> TaskOutcome:
    """Run ``task`` unless its result is there. Once this returns without error, the result is on disk.

    Stops soon after ``cancel_file`` appears; what the task reports is in ``progress_file`` until it ends.
    """
    began, finished = time.perf_counter(), FinishedTasks(folder)
    progress = ProgressFile(progress_file)
    cancelled = CancelFile(cancel_file)
    try:
        settle_encryption(folder.parent)  # a worker elsewhere may not know of the key
        if finished.get(task.key) is None:
            if cancelled():
                raise Cancelled("stopped before it began")
            finished.put(task.key, task.function(task.payload, cancelled, progress.write))
    except Cancelled:
        return TaskOutcome(task.key, time.perf_counter() - began, cancelled=True)
    except (GlovecalError, BadEncryptionKey) as error:
        return TaskOutcome(task.key, time.perf_counter() - began, error=f"{task.label}: {error}")
    finally:
        progress.remove()
    return TaskOutcome(task.key, time.perf_counter() - began)


class CancelFile:
    """Says whether a file exists; looks 20 times a second at most, so it may be asked in every iteration."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._looked_at = float("-inf")
        self._found = False

    def __call__(self) -> bool:
        now = time.monotonic()
        if not self._found and now - self._looked_at >= CANCEL_POLL_S:
            self._looked_at = now
            self._found = self._path.exists()
        return self._found
