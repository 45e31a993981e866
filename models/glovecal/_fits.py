"""The fits of one training, spread over worker processes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from glovecal._calls import Report
from glovecal_models.progress import Cancel
from glovecal_models.worker_processes import work_off

if TYPE_CHECKING:
    from glovecal_models.calibration.fit_task import FitResult, FitTask


def fitted(
    tasks: Sequence[FitTask], workers: int, cancelled: Cancel | None, report: Report
) -> list[FitResult]:
    """All results, in any order. Raises Cancelled, WorkerDied, NotTrainable."""
    from glovecal_models.calibration.fit_task import run_task

    found: list[FitResult] = []

    def take(_: int, result: FitResult) -> None:
        found.append(result)
        report(f"fitted {result.rotation}", len(found) / len(tasks))

    work_off(run_task, tasks, workers, take, "the training", cancelled)
    return found
