"""The recorder as a process: its disk, its database and its Python never make a pose wait."""

from __future__ import annotations

from collections.abc import Callable
from threading import Event, Thread

from glovecal_client.errors import NoAnswer
from glovecal_client.session import open_client
from glovecal_models.threads import pin_blas_to_one_thread
from glovecal_service.recorder.recorder import Recorder
from glovecal_service.recorder.sampling_runner import SamplingRunner
from glovecal_service.settings import Settings
from glovecal_service.store.store import Store

STOP_WITHIN_S = 5.0


def run_recorder(settings: Settings, stopped: Event, started: Callable[[], None] | None = None) -> None:
    """Carry out recordings and samplings until ``stopped``; waits for the router at the start."""
    pin_blas_to_one_thread()
    try:
        with open_client([settings.zenoh], cancelled=stopped.is_set) as session:
            if started is not None:
                started()
            samplings = SamplingRunner(session, settings, lambda: Store.open(settings))
            thread = Thread(target=samplings.run, args=(stopped,), name="samplings", daemon=True)
            thread.start()
            Recorder(session, settings, lambda: Store.open(settings)).run(stopped)
            thread.join(STOP_WITHIN_S)
    except NoAnswer:
        if not stopped.is_set():
            raise
