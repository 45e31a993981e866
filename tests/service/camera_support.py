"""For the tests of cameras: a data folder that is ready, and cameras with faults."""

from __future__ import annotations

import atexit
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from glovecal_client.errors import DeviceFinished
from glovecal_client.pictures.source import Picture
from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.database import DatabaseSettings, pose_database
from glovecal_models.colour_glove.lookup import PoseLookup
from glovecal_models.colour_glove.pattern import printed_pattern
from glovecal_models.colour_glove.pictures.picture_check import PictureCheck
from glovecal_models.colour_glove.pose.hand_tracker import HandTracker
from glovecal_models.colour_glove.pose.window_view import PrintedHand
from glovecal_models.colour_glove.pose_set import generated_poses
from glovecal_models.colour_glove.skin import hand_skin
from glovecal_service.camera import tracking_setup as setup_module
from glovecal_service.camera.camera_settings import CameraSettings, TrackingSettings
from glovecal_service.camera.camera_tracking import CameraSummary, CameraTracking
from glovecal_service.camera.tracking_setup import ASSUMED, RATE_HZ, RenderedGlove, glove_colours

SMALL: dict[str, Any] = {"entries": 300}


BESIDE = Camera(translation_mm=(-60.0, 0.0, 0.0))
"""A second camera, which the small folder is ready for too, beside the assumed one."""


def ready_folder(data: Path) -> RenderedGlove:
    """Put a small database, plain errors and learned colours where a camera keeps them; the glove that
    ``rendered`` draws.

    Learning errors takes half a minute; here the posterior deviations stand as they are. All is made once in
    a run of tests, and copied.
    """
    folder = TrackingSettings(data=data).folder
    try:
        shutil.copytree(_made_once(), folder, dirs_exist_ok=True)
    except (OSError, shutil.Error):  # the process that made it has just ended
        _make(folder)
    return RenderedGlove(PrintedHand(hand_skin(), printed_pattern()), ASSUMED)


def _made_once() -> Path:
    """The folder that is copied; whichever process of this run comes first makes it."""
    run = os.environ.get("PYTEST_XDIST_TESTRUNUID", f"process-{os.getpid()}")
    place = Path(tempfile.gettempdir(), f"glovecal-cameras-{run}")
    if not place.is_dir():
        made = Path(tempfile.mkdtemp(prefix="glovecal-cameras-"))
        _make(made)
        try:
            made.rename(place)
            atexit.register(shutil.rmtree, place, ignore_errors=True)
        except OSError:  # another process was quicker
            shutil.rmtree(made)
    return place


def _make(folder: Path) -> None:
    skin = hand_skin()
    hand, settings = PrintedHand(skin, printed_pattern()), DatabaseSettings(entries=SMALL["entries"])
    pose_database(skin, hand.pattern, generated_poses(), folder, settings, workers=1)
    glove_colours(folder, hand)


@contextmanager
def prepared_once() -> Iterator[None]:
    """Within it this process reads a data folder's database for the same cameras once, not for each camera
    that a test starts: that takes a second each time."""
    really, check, known = setup_module.prepared_tracker, setup_module.PictureCheck, dict[Any, Any]()

    def prepared(folder: Path, cameras: Sequence[Camera], **options: Any) -> HandTracker:
        key = (folder, tuple(cameras), options["entries"])
        if key not in known:
            known[key] = really(folder, cameras, **options)
        return known[key]

    def checked(lookup: PoseLookup) -> PictureCheck:
        return known.setdefault(id(lookup), check(lookup))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(setup_module, "prepared_tracker", prepared)
        patch.setattr(setup_module, "PictureCheck", checked)
        yield


class ScriptedCamera:
    """A camera that does what a list says: pictures, exceptions, and pictures with a stamp of their own."""

    simulated = True
    rate_hz = RATE_HZ

    def __init__(self, acts: list[Any], wait: Callable[[], None] = lambda: None) -> None:
        """``acts``: pixels, (pixels, nanoseconds), exceptions; ``wait`` is called before each."""
        self.name = "camera:0"
        self._acts, self._wait, self._first = acts, wait, None
        self.openings = 0

    def open(self) -> None:
        self.openings += 1

    def read(self) -> Picture:
        if self.openings == 1:  # how large pictures are is asked before the first
            return Picture.now(next(each for each in self._acts if isinstance(each, np.ndarray)))
        if not self._acts:
            raise DeviceFinished("all was done")
        self._wait()
        act = self._acts.pop(0)
        if isinstance(act, BaseException):
            raise act
        if isinstance(act, tuple):
            return Picture(act[0], act[1], act[1])
        return Picture.now(act)

    def close(self) -> None:
        pass


@contextmanager
def running(
    settings: CameraSettings, source: Any = None
) -> Iterator[tuple[CameraTracking, list[Any], list[str]]]:
    """A camera in a thread; a list that gets its summary, or what it raised, at the end; what it said."""
    said: list[str] = []
    tracking, ended, stop = CameraTracking(settings, said.append), [], threading.Event()

    def run() -> None:
        try:
            ended.append(tracking.run(stop, source))
        except Exception as error:
            ended.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield tracking, ended, said
    finally:
        stop.set()
        thread.join(60)
        assert not thread.is_alive()


def ran_to_the_end(settings: CameraSettings, source: Any = None) -> CameraSummary:
    """Of a source that ends by itself."""
    with running(settings, source) as (_, ended, _):
        until = time.monotonic() + 60
        while not ended and time.monotonic() < until:
            time.sleep(0.02)
    assert isinstance(ended[0], CameraSummary), ended[0]
    return ended[0]


@contextmanager
def camera_process(settings: CameraSettings) -> Iterator[subprocess.Popen[bytes]]:
    """As the service starts it; killed at the end."""
    command = [sys.executable, "-P", "-m", "glovecal_service.camera.process", settings.text()]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()
