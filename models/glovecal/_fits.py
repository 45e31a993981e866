"""The fits of one training, spread over worker processes."""

from __future__ import annotations

import os
import threading
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import connection, get_context
from typing import TYPE_CHECKING

from glovecal._calls import Report
from glovecal_models.errors import Cancelled
from glovecal_models.progress import Cancel

if TYPE_CHECKING:
    from glovecal_models.calibration.fit_task import FitResult, FitTask

POLL_S = 0.1
"""How long it may take until a call is seen to be cancelled."""


def fitted(
    tasks: Sequence[FitTask], workers: int, cancelled: Cancel | None, report: Report
) -> list[FitResult]:
    """All results, in any order. Raises Cancelled, and RuntimeError when a worker dies.

    Whatever ends it early, Ctrl-C included, ends the workers at once.
    """
    from glovecal_models.calibration.fit_task import run_task

    context = get_context("spawn")
    theirs, ours = context.Pipe(duplex=False)
    found: list[FitResult] = []
    with theirs, ours, ProcessPoolExecutor(min(workers, len(tasks)), context, _begin, (theirs,)) as pool:
        try:
            waiting = {pool.submit(run_task, task) for task in tasks}
            while waiting:
                if cancelled and cancelled():
                    raise Cancelled("the training was cancelled")
                done, waiting = wait(waiting, POLL_S, FIRST_COMPLETED)
                for future in done:
                    found.append(future.result())
                    report(f"fitted {found[-1].rotation}", len(found) / len(tasks))
        except BrokenProcessPool as error:
            raise RuntimeError(
                "a worker process ended by itself. A script must call train(workers=...) under "
                'if __name__ == "__main__":, as every worker imports it; else use fewer workers'
            ) from error
        except BaseException:
            ours.close()
            raise
    return found


def _begin(stop: connection.Connection) -> None:
    from glovecal_models.threads import begin_worker

    begin_worker()
    threading.Thread(target=_end_with, args=(stop,), daemon=True).start()


def _end_with(stop: connection.Connection) -> None:
    """The caller closed its end: it wants no result any more."""
    connection.wait([stop])
    os._exit(1)
