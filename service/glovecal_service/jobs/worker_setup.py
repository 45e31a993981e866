"""What a worker process does before its first task: log as all do, step back behind the live stream, pin
BLAS, close a port."""

from __future__ import annotations

from distributed import Worker

from glovecal_client.private_files import keep_private
from glovecal_models.worker_processes import pin_blas_to_one_thread
from glovecal_service.jobs.dask_log import silence_dask
from glovecal_service.logs import log_to_stderr
from glovecal_service.operating_system import step_back
from glovecal_service.settings import Settings


def dask_setup(worker: Worker) -> None:
    """Called by Dask in each worker (``preload``)."""
    log_to_stderr(Settings())
    silence_dask()
    step_back()
    pin_blas_to_one_thread()
    keep_private()
    worker.http_server.stop()  # it has nothing to show
