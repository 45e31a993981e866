"""A simulated glove that streams into this service for somebody without one: at most one, and not for ever.

Its capture is a program of its own, this module with a site, an endpoint and a folder for its log.
"""

from __future__ import annotations

import shutil
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

from glovecal_client.capture.command import run_capture, tell
from glovecal_client.capture.daemon import CaptureSettings
from glovecal_client.errors import ClientError
from glovecal_client.keys import GloveKeys
from glovecal_client.private_files import keep_private
from glovecal_client.program import guard_streams, leave_at_once
from glovecal_models.simulation.protocol import segments
from glovecal_models.simulation.simulated_glove import SimulatedGlove, simulate_take
from glovecal_models.takes.take import Take
from glovecal_service.child_process import ChildProcess, stopped_with_the_service
from glovecal_service.plain import reason_of
from glovecal_service.settings import Settings

GLOVE, SUBJECT, LAYOUT = "simulated-glove", "simulated-hand", "cyberglove18"
SEED = 1
TAUGHT, SHOWN = 0, 1
"""Wearings: the glove that streams was put on again after its model's takes."""
TAUGHT_MOTIONS = ("key_poses", "cross_couple", "thumb", "wrist", "free")
TRAINED_SOON = {"samples": 600, "folds": 0}
"""A hand that moves soon; nobody asks for its error."""
LASTS_S = 1800.0


def taught_takes() -> list[Take]:
    """Those that the model of the simulated hand learns from, 40 s in all."""
    glove = SimulatedGlove(SEED, LAYOUT, wearing=TAUGHT)
    return [
        simulate_take(glove, segments(motion, SEED), seed=place, name=motion).take
        for place, motion in enumerate(TAUGHT_MOTIONS)
    ]


@dataclass(frozen=True)
class Streaming:
    is_on: bool
    sentence: str
    """The last that its capture said; "" after it was stopped."""
    left_s: float


class StreamedGlove:
    """The one that this service streams. From any thread."""

    def __init__(self, settings: Settings) -> None:
        self._arguments = settings.site, settings.zenoh, str(settings.data / "simulated-glove")
        self._lock = threading.Lock()
        self._process: ChildProcess | None = None
        self._ends_at = 0.0

    def start(self) -> Streaming:
        """Harmless while it streams already."""
        with self._lock:
            if self._process is None or not self._process.is_on:
                self._end()
                self._process = ChildProcess(__name__, *self._arguments, what="the simulated glove")
                self._ends_at = time.monotonic() + LASTS_S
            return self._state()

    def state(self) -> Streaming:
        with self._lock:
            return self._state()

    def stop(self) -> Streaming:
        """Harmless where none streams."""
        with self._lock:
            self._end()
            self._process = None
            return self._state()

    def _end(self) -> None:
        if self._process is not None:
            self._process.end()

    def _state(self) -> Streaming:
        if self._process is None:
            return Streaming(False, "", 0.0)
        left_s = max(0.0, self._ends_at - time.monotonic()) if self._process.is_on else 0.0
        return Streaming(self._process.is_on, self._process.sentence, left_s)


def main(site: str, endpoint: str, folder: str) -> int:
    """0, or 1 with a sentence on standard error. The log of its frames is gone at its end."""
    keep_private()
    log = Path(folder)
    shutil.rmtree(log, ignore_errors=True)  # of one that was killed
    settings = CaptureSettings(GloveKeys(site, GLOVE), SUBJECT, "shown", (endpoint,), log)
    options = {"seed": SEED, "layout": LAYOUT, "wearing": SHOWN, "duration": LASTS_S}
    texts = {name: f"{value}" for name, value in options.items()}
    try:
        with stopped_with_the_service() as stop:
            run_capture("simulated", settings, texts, stop=stop, report=tell)
    except ClientError as error:
        tell(reason_of(error))
        return 1
    finally:
        shutil.rmtree(log, ignore_errors=True)
    return 0


if __name__ == "__main__":
    guard_streams()
    leave_at_once(main(*sys.argv[1:]))
