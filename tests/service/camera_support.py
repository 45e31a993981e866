"""For the tests of cameras: a data folder that is ready, and cameras with faults."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from glovecal_client.errors import DeviceFinished
from glovecal_client.pictures.source import Picture
from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.codes.pca import pca_code
from glovecal_models.colour_glove.database import DatabaseSettings, pose_database
from glovecal_models.colour_glove.hand_state import DEGREES_OF_FREEDOM
from glovecal_models.colour_glove.lookup import PoseLookup
from glovecal_models.colour_glove.pattern import printed_pattern
from glovecal_models.colour_glove.pose.error_learning import errors_file
from glovecal_models.colour_glove.pose.learned_errors import LearnedErrors
from glovecal_models.colour_glove.pose.window_view import PrintedHand
from glovecal_models.colour_glove.pose_set import generated_poses
from glovecal_models.colour_glove.skin import hand_skin
from glovecal_service.camera.camera_settings import CameraSettings, TrackingSettings
from glovecal_service.camera.camera_tracking import CameraSummary, CameraTracking
from glovecal_service.camera.rendered_glove import RATE_HZ, RenderedGlove
from glovecal_service.camera.tracking_setup import ASSUMED

SMALL: dict[str, Any] = {"entries": 300, "clips": 3}


def ready_folder(data: Path, *others: tuple[Camera, ...]) -> RenderedGlove:
    """Put a small database and plain errors where a camera keeps them; the glove that ``rendered`` draws.

    Learning errors takes half a minute; here the posterior deviations stand as they are. ``others``: cameras
    beside the assumed one that the hand is to be tracked by.
    """
    skin = hand_skin()
    hand, settings = PrintedHand(skin, printed_pattern()), DatabaseSettings(entries=SMALL["entries"])
    folder = TrackingSettings(data=data).folder
    database = pose_database(skin, hand.pattern, generated_poses(), folder, settings, workers=1)
    lookup = PoseLookup(database, pca_code(database.transforms))
    deviation = np.array([15.0] * 20 + [15.0] * 3 + [20.0, 20.0, 60.0])
    errors = LearnedErrors.as_posterior(np.diag(deviation**2), np.full(DEGREES_OF_FREEDOM, 60.0))
    for cameras in ((ASSUMED,), *others):
        errors.save(errors_file(hand, lookup, cameras, SMALL["clips"]))
    return RenderedGlove(hand, ASSUMED)


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
