"""The recorder and the real capture daemon, each in a thread of the test."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from realtime_support import LAYOUT, SteadyDevice, free_endpoint

from glovecal_client.capture.daemon import CaptureDaemon, CaptureSettings
from glovecal_client.keys import GloveKeys
from glovecal_client.session import open_client
from glovecal_service.realtime.recorder import Recorder
from glovecal_service.settings import Settings
from glovecal_service.store import Store

GLOVE = "g1"


def recorder_settings(folder: Path) -> Settings:
    return Settings(data=folder, database=None, artifacts=None, zenoh=free_endpoint(), site="lab")


@contextmanager
def store_with_glove(settings: Settings) -> Iterator[Store]:
    """Anna wears ``GLOVE`` in the morning."""
    with Store.open(settings) as store:
        store.gloves.seen(GLOVE, {"layout": LAYOUT.name, "subject": "anna", "wearing": "morning"})
        yield store


@contextmanager
def capturing(
    settings: Settings, data: Path | None = None, device: SteadyDevice | None = None
) -> Iterator[None]:
    """The capture daemon with a glove at 200 Hz; its log below ``data``, the settings' folder by default."""
    stop = threading.Event()
    folder = (data or settings.data) / "captured"
    capture = CaptureSettings(GloveKeys(settings.site, GLOVE), "anna", "morning", (settings.zenoh,), folder)
    daemon = CaptureDaemon(device or SteadyDevice(200.0), capture, lambda sentence: None)
    thread = threading.Thread(target=daemon.run, args=(stop,))
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join(120)


@contextmanager
def recording_thread(settings: Settings) -> Iterator[Recorder]:
    """The recorder as its process runs it."""
    stop = threading.Event()
    with open_client([settings.zenoh], wait_s=20) as session:
        it = Recorder(session, settings, lambda: Store.open(settings))
        thread = threading.Thread(target=it.run, args=(stop,))
        thread.start()
        try:
            yield it
        finally:
            stop.set()
            thread.join(120)
