"""The recorder as a process: its disk, its database and its Python never make a pose wait."""

from __future__ import annotations

from collections.abc import Callable
from threading import Event

from glovecal_client.errors import NoAnswer
from glovecal_client.session import open_client
from glovecal_models.threads import pin_blas_to_one_thread
from glovecal_service.realtime.recorder import Recorder
from glovecal_service.settings import Settings
from glovecal_service.store.store import Store


def run_recorder(settings: Settings, stopped: Event, started: Callable[[], None] | None = None) -> None:
    """Carry out recordings until ``stopped``; waits for the router at the start."""
    pin_blas_to_one_thread()
    try:
        with open_client([settings.zenoh], cancelled=stopped.is_set) as session:
            if started is not None:
                started()
            Recorder(session, settings, lambda: Store.open(settings)).run(stopped)
    except NoAnswer:
        if not stopped.is_set():
            raise
