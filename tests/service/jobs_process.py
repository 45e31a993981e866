"""A process that is killed by tests: opens a store, runs its jobs, says what it does on standard output."""

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


def write_rows(settings: Settings) -> None:
    """Create subjects and activate models for ever; a line is printed once a write was acknowledged."""
    with Store.open(settings) as store:
        subject = f"s{time.time_ns()}"
        store.subjects.create(subject)
        print("subject", subject, flush=True)
        while True:
            artifact = str(time.time_ns()).encode()
            model = store.models.add(
                artifact, subject=subject, layout="glove", method="linear", parent=None, facts={}
            )
            print("model", model.id, flush=True)
            store.models.activate(model.id)
            print("active", model.id, flush=True)


if __name__ == "__main__":
    what, data, database = sys.argv[1:4]
    chosen = Settings(data=Path(data), database=database or None, artifacts=None, scheduler=None, workers=2)
    {"jobs": run_jobs, "rows": write_rows}[what](chosen)
