"""A process that is killed by tests: it runs the jobs of a store."""

from __future__ import annotations

import sys
import time
from pathlib import Path

from jobs_counting import CountingJob

from glovecal_service.jobs.dispatcher import Dispatcher
from glovecal_service.settings import Settings
from glovecal_service.store import Store


def run_jobs(settings: Settings) -> None:
    """Run jobs until all are finished."""
    with Store.open(settings) as store, Dispatcher(store, settings, {"count": CountingJob()}):
        while store.jobs.list(only_unfinished=True):
            time.sleep(0.05)


if __name__ == "__main__":
    data, database = sys.argv[1:3]
    run_jobs(Settings(data=Path(data), database=database or None, artifacts=None, scheduler=None, workers=1))
