"""A recorder, a service, a capture daemon or a network that stood still: no frame is lost, and none made up.

What waits in a buffer meanwhile arrives at once, and right after it the glove is far ahead. The capture log
has every frame.
"""

from __future__ import annotations

import dataclasses
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from threading import Event

import pytest
from realtime_support import SteadyDevice, eventually, free_endpoint
from recorder_support import GLOVE, capturing, goes_on, logged, recording_thread

from glovecal_client import Recording
from glovecal_client.capture.device import Reading
from glovecal_client.session import open_client, open_router
from glovecal_service.incoming.glove_owners import GloveOwners
from glovecal_service.recorder.recorder import Recorder
from glovecal_service.settings import Settings
from glovecal_service.store import Store
from glovecal_service.store.recordings import STOP_ASKED
from glovecal_service.store.records import RecordingRecord

RATE_HZ = 120


class TimeLapse(SteadyDevice):
    """Minutes of a glove in a moment: frames come as fast as they are asked for, their clock says 120 Hz."""

    def __init__(self) -> None:
        super().__init__(RATE_HZ)
        self.wanted = self.given = 0
        self._behind_ns = 3600 * 1_000_000_000

    def read(self, timeout_s: float) -> Reading | None:
        if self.given >= self.wanted:
            time.sleep(0.001)
            return None
        self._due = 0.0
        reading = super().read(0.0)
        assert reading is not None
        if not self.given:
            self._began = reading.monotonic_ns - self._behind_ns, reading.wall_ns - self._behind_ns
        since_ns = self.given * 1_000_000_000 // RATE_HZ
        self.given += 1
        monotonic_ns, wall_ns = self._began
        return dataclasses.replace(reading, monotonic_ns=monotonic_ns + since_ns, wall_ns=wall_ns + since_ns)


def recorded(store: Store, id: str) -> int:
    return store.recordings.get(id).facts.get("recorded", 0)


def stopped(store: Store, id: str) -> RecordingRecord:
    store.recordings.stop(id)
    eventually(lambda: store.recordings.get(id).state in ("done", "failed"), "nothing is left to repair")
    return store.recordings.get(id)


def test_numbers_far_ahead_are_judged_by_the_clock_of_their_frames(settings: Settings, store: Store) -> None:
    """Fifty seconds of frames that nobody heard, and then the next one, a moment later by our clock."""
    device, unheard = TimeLapse(), 50 * RATE_HZ
    with ExitStack() as running:
        router = running.enter_context(ExitStack())
        router.enter_context(open_router([settings.zenoh]))
        running.enter_context(capturing(settings, device=device))
        running.enter_context(recording_thread(settings))
        asked = store.recordings.request(GLOVE, name="stood still", lead_s=0)
        eventually(lambda: store.recordings.get(asked.id).state == "recording", "it is recorded")

        def heard_more_than(frames: int) -> bool:
            device.wanted += 10
            return recorded(store, asked.id) > frames

        eventually(lambda: heard_more_than(200), "the first frames")
        eventually(lambda: device.given == device.wanted, "no more for now")
        router.close()
        at_most_heard = device.given
        device.wanted += unheard
        eventually(lambda: device.given == device.wanted, "frames that nobody hears")
        running.enter_context(open_router([settings.zenoh]))
        eventually(lambda: heard_more_than(at_most_heard), "the recorder hears the glove again")
        record = stopped(store, asked.id)
        in_log = [frame.sequence for frame in Recording.open(logged(settings)[-1]).frames()]
    assert (record.state, record.facts["missing"]) == ("done", [])
    assert record.facts["repaired"] >= unheard
    assert len(in_log) == device.given
    assert record.facts["recorded"] == record.facts["sent"] >= 200 + unheard
    assert store.takes.get(record.facts["take"]).frames == record.facts["recorded"]


def test_a_stop_asked_for_meanwhile_ends_the_recording_there(settings: Settings, store: Store) -> None:
    """What came after it waits with all the rest, and is not of the recording."""
    with (
        open_router([settings.zenoh]),
        capturing(settings),
        open_client([settings.zenoh], wait_s=20) as session,
    ):
        owners = GloveOwners(session, settings.site, "recorder-1")
        recorder = Recorder(session, settings, lambda: Store.open(settings), owners)
        asked = store.recordings.request(GLOVE, name="stopped meanwhile", lead_s=0)

        def until(state: str) -> None:
            def looked() -> bool:
                recorder.look()
                return store.recordings.get(asked.id).state == state

            eventually(looked, state)

        until("recording")
        goes_on(settings, 60)
        store.recordings.stop(asked.id)
        goes_on(settings, 400)
        until("done")
        stopping = Event()
        stopping.set()
        recorder.run(stopping)
    record = store.recordings.get(asked.id)
    frames = list(Recording.open(settings.recordings_folder / record.facts["file"]).frames())
    assert len(frames) == record.facts["recorded"] > 20
    late_s = max(frame.wall_ns for frame in frames) / 1e9 - record.facts[STOP_ASKED]
    assert late_s < 1.0, "of two seconds; two clocks are compared by a question and its answer"


@contextmanager
def service_and_capture(folder: Path) -> Iterator[dict[str, list[int]]]:
    """Both as their commands start them; the ids of their processes."""
    zenoh, log = free_endpoint(), folder / "serve.log"
    port = free_endpoint().rpartition(":")[2]
    environment = os.environ | {"GLOVECAL_DATA": str(folder), "GLOVECAL_ZENOH": zenoh, "GLOVECAL_PORT": port}
    serve = [sys.executable, "-m", "glovecal_service.cli.command", "serve", "--no-studio"]
    capture = [sys.executable, "-m", "glovecal_client.capture.command", "--device", "simulated"]
    capture += ["--glove", GLOVE, "--subject", "anna", "--wearing", "morning"]
    capture += ["--connect", zenoh, "--data", str(folder / "captured")]
    with ExitStack() as running:
        output = running.enter_context(log.open("wb"))

        def start(command: list[str]) -> int:
            process = subprocess.Popen(command, env=environment, stdout=output, stderr=subprocess.STDOUT)
            running.callback(process.wait)
            running.callback(process.terminate)
            return process.pid

        served = start(serve)
        eventually(lambda: "Glovecal is running" in log.read_text(), "the service is there", 300)
        captured = start(capture)
        children = Path(f"/proc/{served}/task/{served}/children").read_text().split()
        real_time, recorder, *_ = sorted(map(int, children))
        yield {
            "capture": [captured],
            "recorder": [recorder],
            "real time": [real_time],
            "service": [served, *map(int, children)],
        }


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the processes of a service are found in /proc")
@pytest.mark.parametrize("seconds", [5, 20, 60])
@pytest.mark.parametrize("who", ["capture", "recorder", "real time", "service"])
def test_a_process_that_was_stopped_costs_no_frame(tmp_path: Path, who: str, seconds: int) -> None:
    with service_and_capture(tmp_path) as processes:
        settings = Settings(data=tmp_path, database=None, artifacts=None)
        with Store.open(settings) as store:
            eventually(lambda: store.gloves.list(), "the glove is known")
            asked = store.recordings.request(GLOVE, name="stopped", lead_s=0)
            eventually(lambda: recorded(store, asked.id) > RATE_HZ, "a second of frames")
            before = recorded(store, asked.id)
            for process in processes[who]:
                os.kill(process, signal.SIGSTOP)
            time.sleep(seconds)
            for process in processes[who]:
                os.kill(process, signal.SIGCONT)
            eventually(lambda: recorded(store, asked.id) > before + 5 * RATE_HZ, "frames afterwards")
            time.sleep(2.0)
            record = stopped(store, asked.id)
    assert (record.state, record.facts["missing"]) == ("done", []), record.facts
    run_id, first = int(record.facts["runs"][0]["run_id"], 16), record.facts["first_sequence"]
    frames = [frame for frame in Recording.open(logged(settings)[-1]).frames() if frame.sequence >= first]
    file = settings.recordings_folder / record.facts["file"]
    kept = {frame.sequence for frame in Recording.open(file).frames() if frame.run_id == run_id}
    asked_ns = 1e9 * record.facts[STOP_ASKED]
    assert {frame.sequence for frame in frames if frame.wall_ns <= asked_ns} <= kept
