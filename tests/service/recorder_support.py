"""The recorder and the real capture daemon, in threads of the test or processes to be killed."""

from __future__ import annotations

import secrets
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
from realtime_support import LAYOUT, SteadyDevice, eventually, free_endpoint

from glovecal_client import DamagedLog, Frame, FrameLog, Recording, encode_frame
from glovecal_client.capture.daemon import CaptureDaemon, CaptureSettings
from glovecal_client.keys import GloveKeys
from glovecal_client.session import open_client
from glovecal_service.incoming.glove_owners import GloveOwners
from glovecal_service.recorder import recorder
from glovecal_service.recorder.recorder import Recorder
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
    settings: Settings, data: Path | None = None, device: SteadyDevice | None = None, glove: str = GLOVE
) -> Iterator[None]:
    """The capture daemon with a glove at 200 Hz; its log below ``data``, the settings' folder by default."""
    stop = threading.Event()
    folder = (data or settings.data) / "captured"
    capture = CaptureSettings(GloveKeys(settings.site, glove), "anna", "morning", (settings.zenoh,), folder)
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
        owners = GloveOwners(session, settings.site, f"recorder-{secrets.token_hex(4)}")
        it = Recorder(session, settings, lambda: Store.open(settings), owners)
        thread = threading.Thread(target=it.run, args=(stop,))
        thread.start()
        try:
            yield it
        finally:
            stop.set()
            thread.join(120)


def quick_recorder(settings: Settings, stopped: threading.Event, started: Callable[[], None]) -> None:
    """The recorder process, which takes over what is abandoned after two seconds, not ten."""
    recorder.TAKE_OVER_AFTER_S = 2.0
    recorder.run_recorder(settings, stopped, started)


def patient_recorder(settings: Settings, stopped: threading.Event, started: Callable[[], None]) -> None:
    """The recorder process; another one has the time to be started again, however busy the computer is."""
    recorder.TAKE_OVER_AFTER_S = 100.0
    recorder.run_recorder(settings, stopped, started)


def logged(settings: Settings) -> list[Path]:
    """Oldest first."""
    logs = (settings.data / "captured" / "capture" / "lab" / GLOVE).glob("*.glvlog")
    return sorted(logs, key=lambda log: log.stat().st_mtime_ns)


def in_logs(settings: Settings) -> int:
    """Frames that capture has logged."""
    count = 0
    for log in logged(settings):
        with suppress(DamagedLog):  # its header is being written
            count += len(list(Recording.open(log).payloads()))
    return count


def goes_on(settings: Settings, frames: int) -> None:
    """Wait until capture has logged so many more: a busy computer has them later."""
    before = in_logs(settings)
    eventually(lambda: in_logs(settings) >= before + frames, f"{frames} more frames")


def replay_source(folder: Path) -> Path:
    log = FrameLog.create(folder / "source.glvlog", {"layout": LAYOUT.name, "sensors": list(LAYOUT.sensors)})
    for i in range(400):
        log.append(encode_frame(Frame(i, 1, i * 5_000_000, 0, np.array([i % 250, 1, 2], np.float32))))
    log.close()
    return log.path


@contextmanager
def capture_process(settings: Settings) -> Iterator[subprocess.Popen[bytes]]:
    source = settings.data / "source.glvlog"
    source = source if source.exists() else replay_source(settings.data)
    command = [sys.executable, "-m", "glovecal_client.capture.command", "--device", f"replay:{source}"]
    command += ["--option", "loop=yes", "--glove", GLOVE, "--subject", "anna", "--wearing", "morning"]
    command += ["--connect", settings.zenoh, "--data", str(settings.data / "captured")]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.kill()
        process.wait()
