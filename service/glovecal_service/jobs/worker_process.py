"""A training process on another computer: ``python -m glovecal_service.jobs.worker_process``.

Its first line of standard input says where its scheduler is and with which keys; it ends when its standard
input does, whatever ended its parent. It says "ready" on standard output once the scheduler knows it.
"""

from __future__ import annotations

import asyncio
import json
import logging
import os
import secrets
import sys
import tempfile
import threading
from collections.abc import Mapping
from importlib import import_module
from typing import Any

from glovecal_client.private_files import keep_private
from glovecal_client.program import leave_signals_to_the_parent
from glovecal_models.worker_processes import pin_blas_to_one_thread
from glovecal_service.jobs.code_identity import code_identity
from glovecal_service.jobs.dask_log import silence_dask
from glovecal_service.jobs.workers import CONFIG, IMPORTED_ONCE
from glovecal_service.operating_system import step_back

NOWHERE = 9
"""A port that nobody listens at: the scheduler never connects to a worker."""
SCHEDULER_LOST, OTHER_CODE = 3, 4
"""Exit codes; the latter: what is installed here is not what the service was told of."""


def main() -> None:
    leave_signals_to_the_parent()
    begin = json.loads(sys.stdin.readline())
    if code_identity() != begin["code"]:
        sys.exit(OTHER_CODE)
    threading.Thread(target=_end_with_the_parent, daemon=True).start()
    logging.basicConfig(level=logging.WARNING)
    step_back()
    pin_blas_to_one_thread()
    keep_private()
    with tempfile.TemporaryDirectory(prefix="glovecal-worker-") as folder:
        asyncio.run(_work(begin, folder))
    os._exit(SCHEDULER_LOST)  # a fit may still be running in a thread


def _end_with_the_parent() -> None:
    while os.read(0, 4096):
        pass
    os._exit(0)


async def _work(begin: Mapping[str, Any], folder: str) -> None:
    """Until the scheduler is gone."""
    from dask.config import set as configure
    from distributed import Security, Worker

    for name in IMPORTED_ONCE:  # before the first task comes
        import_module(name)
    silence_dask()
    configure(CONFIG)
    # unlike those of all other workers, so that the scheduler can tell them apart
    one, two, three = secrets.token_bytes(3)
    async with Worker(
        f"tls://127.0.0.1:{begin['port']}",
        name=f"{begin['name']}-{secrets.token_hex(4)}",
        nthreads=1,
        host="127.0.0.1",
        contact_address=f"tls://127.{one}.{two}.{three}:{NOWHERE}",
        security=Security(require_encryption=True, **begin["keys"]),
        local_directory=folder,
        memory_limit=0,
        dashboard=False,
    ) as worker:
        worker.http_server.stop()  # it has nothing to show
        print("ready", flush=True)
        await worker.finished()


if __name__ == "__main__":
    main()
