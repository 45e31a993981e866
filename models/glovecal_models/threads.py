"""One BLAS thread per process (two made small fits 16 times slower on two cores), and how a worker begins."""

from __future__ import annotations

import os
import signal
import threading
from multiprocessing import connection, parent_process

from threadpoolctl import threadpool_limits

_limits: threadpool_limits | None = None


def pin_blas_to_one_thread() -> None:
    """Limit BLAS and OpenMP pools of this process to one thread, for as long as it lives."""
    global _limits
    if _limits is None:
        import numpy.linalg  # noqa: F401  the pools exist only once the libraries are loaded
        import scipy.linalg  # noqa: F401

        _limits = threadpool_limits(limits=1)


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
