"""Processes that are killed by tests: each writes to a store and says what was acknowledged."""

from __future__ import annotations

import sys
import time
from functools import partial
from pathlib import Path

from forked_children import fork_for_each_line

from glovecal_service.settings import Settings
from glovecal_service.store import Store


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
    given = Settings(data=Path(sys.argv[1]), database=sys.argv[2] or None, artifacts=None)
    fork_for_each_line(partial(write_rows, given))
