"""What a worker process of a script does before its first task."""

from __future__ import annotations

import os
import signal
import threading
from multiprocessing import connection, parent_process

from glovecal_models.threads import pin_blas_to_one_thread


def begin_worker() -> None:
    """One BLAS thread; no word at Ctrl-C, which the parent answers; no life without the parent."""
    pin_blas_to_one_thread()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()


def _end_with(sentinel: int) -> None:
    connection.wait([sentinel])
    os._exit(1)
