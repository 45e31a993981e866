"""A process of its own that runs the jobs of a store: tests kill it, or break its children."""

from __future__ import annotations

import logging
import os
import sys
import time
from pathlib import Path

from jobs_counting import CountingJob

from glovecal_service.jobs.dispatcher import Dispatcher
from glovecal_service.settings import Settings
from glovecal_service.store import Store


def run_jobs(settings: Settings) -> None:
    """Run jobs until all are finished."""
    with Store.open(settings) as store, Dispatcher(store, settings, lambda: {"count": CountingJob()}):
        while store.jobs.list(only_unfinished=True):
            time.sleep(0.05)


if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO)  # on standard error, as the service does
    data, database, *of_children = sys.argv[1:]
    if of_children:
        import distributed  # noqa: F401  # whole here, and replaced by what lies in that folder for children

        os.environ["PYTHONPATH"] = of_children[0]
        sys.path.insert(0, of_children[0])  # newer Pythons hand this to children instead
    run_jobs(Settings(data=Path(data), database=database or None, artifacts=None, workers=1))
