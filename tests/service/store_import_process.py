"""Processes that are killed by tests: each imports files of many takes and says which are kept."""

from __future__ import annotations

import hashlib
import sys
import time
from functools import partial
from pathlib import Path

from forked_children import fork_for_each_line
from stored_takes import LAYOUT, make_take

from glovecal_service.settings import Settings
from glovecal_service.store import Store

TAKES_OF_A_FILE = 12


def import_files(settings: Settings) -> None:
    """Import ever new files; the hash of a file is printed once it was acknowledged."""
    with Store.open(settings) as store:
        while True:
            seed = time.time_ns() % 2**32
            file = hashlib.sha256(str(seed).encode()).hexdigest()
            takes = [make_take(seed + n, f"t{n}", frames=20) for n in range(TAKES_OF_A_FILE)]
            store.takes.add_all(
                takes, subject="anna", layout=LAYOUT.name, source="import", original_sha256=file
            )
            print(file, flush=True)


if __name__ == "__main__":
    given = Settings(data=Path(sys.argv[1]), database=sys.argv[2] or None, artifacts=None)
    fork_for_each_line(partial(import_files, given))
