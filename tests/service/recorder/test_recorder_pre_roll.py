"""The frames before a recording, with the real capture daemon: what comes, what does not, what is said."""

from __future__ import annotations

import os
import shutil
import signal
import time
from contextlib import suppress

import numpy as np
import pytest
from realtime_support import SteadyDevice, eventually, part_of_service
from recorder_support import (
    GLOVE,
    capture_process,
    capturing,
    goes_on,
    logged,
    recording_thread,
)

from glovecal_client import DamagedLog, Recording
from glovecal_client.session import open_router
from glovecal_models.errors import BadInput
from glovecal_service.recorder import pre_roll, run_ledger
from glovecal_service.serve import recorder
from glovecal_service.settings import Settings
from glovecal_service.store import Store
from glovecal_service.store.records import RecordingRecord


@pytest.fixture(autouse=True)
def room_on_any_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_ledger, "LEFT_FREE_BYTES", 0)


class PausingDevice(SteadyDevice):
    """Silent for a while after so many frames."""

    def __init__(self, after: int, silent_s: float) -> None:
        super().__init__(200.0)
        self._after, self._silent_s, self.frames = after, silent_s, 0

    def read(self, timeout_s: float):
        if self.frames == self._after:
            time.sleep(self._silent_s)
            self._due = time.monotonic()
        self.frames += 1
        return super().read(timeout_s)


def captured(settings: Settings, frames: int, *, runs: int = 1) -> None:
    """Wait until the log of the newest of so many runs holds so many frames."""

    def are_there() -> bool:
        logs = logged(settings)
        with suppress(DamagedLog):  # its header is being written
            return len(logs) == runs and len(list(Recording.open(logs[-1]).payloads())) >= frames
        return False

    eventually(are_there, f"{frames} frames in the log")


def recorded(store: Store, id: str, frames: int) -> None:
    eventually(lambda: store.recordings.get(id).facts.get("recorded", 0) >= frames, f"{frames} frames")


def pre_roll_sentence(store: Store, id: str) -> str:
    return store.recordings.get(id).facts["pre_roll"].get("sentence", "")


def finished(store: Store, id: str) -> RecordingRecord:
    store.recordings.stop(id)
    eventually(lambda: not store.recordings.get(id).is_open, "the end of the recording")
    record = store.recordings.get(id)
    if record.state != "repairing":
        check(store, record)
    return record


def check(store: Store, record: RecordingRecord) -> None:
    """The pre-roll is counted apart and precedes what was asked for, without a hole and in one run."""
    facts, lead = record.facts, record.facts["pre_roll"]
    assert record.state == "done", facts
    assert facts["sent"] == facts["recorded"] + facts["missing_frames"]
    take = store.takes.load(facts["take"])
    assert len(take.time_s) == facts["recorded"] + lead["frames"]
    assert take.pre_roll_frames == lead["frames"]
    kept = store.takes.get(facts["take"]).accounting
    assert kept is not None
    assert kept["begins_s"] == take.start_s
    assert take.start_s - take.time_s[0] == pytest.approx(lead["seconds"], abs=1e-6)
    assert kept["pre_roll"] == lead
    assert (np.diff(take.time_s[: lead["frames"] + 1]) < 1.0).all()


def test_a_recording_begins_with_the_seconds_before_it(settings: Settings, store: Store) -> None:
    with open_router([settings.zenoh]), capturing(settings), recording_thread(settings):
        captured(settings, 500)
        asked = store.recordings.request(GLOVE, name="walk", lead_s=1.5)
        recorded(store, asked.id, 100)
        record = finished(store, asked.id)
    lead = record.facts["pre_roll"]
    assert lead["asked_s"] == 1.5
    assert lead["seconds"] == pytest.approx(1.5, abs=0.1)
    assert lead["sentence"] == f"1.5 of the 1.5 s before it ({lead['frames']} frames)"
    assert record.facts["missing"] == []
    assert record.facts["repaired"] < lead["frames"], "the pre-roll is no repair; a frame late at the stop is"
    frames = list(Recording.open(settings.recordings_folder / record.facts["file"]).frames())
    own = record.facts["first_sequence"]
    assert frames[0].sequence == own, "what was asked for is on disk before the pre-roll"
    numbers = sorted(frame.sequence for frame in frames)
    assert numbers == list(range(own - lead["frames"], own + record.facts["recorded"]))


def test_none_is_fetched_when_none_is_asked_for(settings: Settings, store: Store) -> None:
    with open_router([settings.zenoh]), capturing(settings), recording_thread(settings):
        captured(settings, 100)
        asked = store.recordings.request(GLOVE, name="walk", lead_s=0)
        recorded(store, asked.id, 50)
        record = finished(store, asked.id)
    assert record.facts["pre_roll"] == {
        "asked_s": 0, "frames": 0, "seconds": 0.0, "sentence": "none was asked for"
    }  # fmt: skip


def test_a_run_that_is_shorter_gives_what_it_has_and_nothing_of_the_run_before(
    settings: Settings, store: Store
) -> None:
    with open_router([settings.zenoh]), recording_thread(settings):
        with capturing(settings):
            captured(settings, 200)
        with capturing(settings):
            captured(settings, 150, runs=2)
            asked = store.recordings.request(GLOVE, name="short")
            recorded(store, asked.id, 50)
            record = finished(store, asked.id)
    assert len(logged(settings)) == 2
    lead = record.facts["pre_roll"]
    assert lead["frames"] == record.facts["first_sequence"] >= 150
    assert lead["sentence"].endswith("frames): the run began then")
    assert len(record.facts["runs"]) == 1
    assert record.facts["missing"] == []


def test_it_ends_at_a_pause_after_which_nothing_remembers(settings: Settings, store: Store) -> None:
    device = PausingDevice(after=100, silent_s=1.3)
    with open_router([settings.zenoh]), capturing(settings, device=device), recording_thread(settings):
        captured(settings, 200)
        asked = store.recordings.request(GLOVE, name="paused")
        recorded(store, asked.id, 50)
        record = finished(store, asked.id)
    assert record.facts["pre_roll"]["frames"] == record.facts["first_sequence"] - 100
    assert "before that the glove was silent for 1." in record.facts["pre_roll"]["sentence"]


def test_it_ends_where_somebody_said_who_wears_the_glove(settings: Settings, store: Store) -> None:
    with open_router([settings.zenoh]), capturing(settings), recording_thread(settings):
        captured(settings, 300)
        store.subjects.create("ben")
        said_at = time.monotonic()
        store.gloves.assign(GLOVE, "ben", "after lunch")
        goes_on(settings, 100)
        asked = store.recordings.request(GLOVE, name="another wearing")
        recorded(store, asked.id, 50)
        record = finished(store, asked.id)
    take = store.takes.load(record.facts["take"])
    assert take.time_s[0] > said_at - 0.05
    assert record.facts["pre_roll"]["seconds"] > 0.3
    assert "who wears the glove was said only then" in record.facts["pre_roll"]["sentence"]


def written(settings: Settings, id: str) -> list[int]:
    file = settings.recordings_folder / f"{id}.glog"
    if not file.exists():
        return []
    return [frame.sequence for frame in Recording.open(file).frames()]


def test_capture_killed_while_it_is_fetched_leaves_the_recording_as_it_is(
    settings: Settings, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    """kill -9 after the first blocks; the take has what came, and its own frames."""
    monkeypatch.setattr(pre_roll, "BLOCK_FRAMES", 16)
    monkeypatch.setattr(pre_roll, "PAUSE_S", 0.15)
    monkeypatch.setattr(pre_roll, "TRY_AGAIN_AFTER_S", 0.1)
    with open_router([settings.zenoh]), recording_thread(settings):
        with capture_process(settings) as process:
            captured(settings, 300)
            asked = store.recordings.request(GLOVE, name="killed")
            eventually(
                lambda: (numbers := written(settings, asked.id)) and min(numbers) < numbers[0],
                "the first of the pre-roll",
            )
            process.send_signal(signal.SIGKILL)
            process.wait()
        eventually(
            lambda: "did not give more" in pre_roll_sentence(store, asked.id),
            "it is said",
        )
        record = finished(store, asked.id)
    lead = record.facts["pre_roll"]
    assert 0 < lead["frames"] < record.facts["first_sequence"]
    assert record.state == "repairing"
    assert store.takes.load(record.facts["take"]).pre_roll_frames == lead["frames"]


def test_capture_that_comes_back_still_has_the_log_of_the_run_before(
    settings: Settings, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pre_roll, "BLOCK_FRAMES", 16)
    monkeypatch.setattr(pre_roll, "PAUSE_S", 0.1)
    monkeypatch.setattr(pre_roll, "TRY_AGAIN_AFTER_S", 0.1)
    with open_router([settings.zenoh]), recording_thread(settings):
        with capture_process(settings) as process:
            captured(settings, 200)
            asked = store.recordings.request(GLOVE, name="twice")
            eventually(lambda: len(written(settings, asked.id)) > 30, "the first of the pre-roll")
            process.send_signal(signal.SIGKILL)
            process.wait()
        monkeypatch.setattr(pre_roll, "PAUSE_S", 0.0)
        with capture_process(settings):
            eventually(
                lambda: pre_roll_sentence(store, asked.id).endswith("began then"),
                "all of it",
            )
            recorded(store, asked.id, 100)
            record = finished(store, asked.id)
    assert len(record.facts["runs"]) == 2
    assert record.facts["pre_roll"]["frames"] == record.facts["first_sequence"]
    assert record.facts["missing"] == []


def test_a_log_that_is_gone_is_said_and_the_recording_goes_on(settings: Settings, store: Store) -> None:
    with open_router([settings.zenoh]), capturing(settings), recording_thread(settings):
        captured(settings, 100)
        os.truncate(logged(settings)[-1], 0)
        asked = store.recordings.request(GLOVE, name="no log")
        recorded(store, asked.id, 100)
        record = finished(store, asked.id)
    assert record.facts["pre_roll"]["frames"] == 0
    assert "capture's log did not give more" in record.facts["pre_roll"]["sentence"]
    assert record.facts["recorded"] >= 100


def test_a_killed_recorder_goes_on_with_it(
    settings: Settings, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    with open_router([settings.zenoh]), capturing(settings):
        captured(settings, 600)
        with part_of_service(recorder, settings) as process:
            asked = store.recordings.request(GLOVE, name="killed recorder")
            recorded(store, asked.id, 20)
            process.kill()
            process.join()
        with recording_thread(settings):
            recorded(store, asked.id, store.recordings.get(asked.id).facts["recorded"] + 100)
            record = finished(store, asked.id)
    lead = record.facts["pre_roll"]
    assert lead["frames"] == record.facts["first_sequence"] >= 600
    assert lead["sentence"].endswith("the run began then")
    assert record.facts["missing"] == []


def test_a_nearly_full_disk_gets_no_pre_roll(
    settings: Settings, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_ledger, "LEFT_FREE_BYTES", shutil.disk_usage(settings.data).free + (1 << 40))
    with open_router([settings.zenoh]), capturing(settings), recording_thread(settings):
        captured(settings, 100)
        asked = store.recordings.request(GLOVE, name="full")
        recorded(store, asked.id, 50)
        record = finished(store, asked.id)
    assert record.facts["pre_roll"]["frames"] == 0
    assert record.facts["pre_roll"]["sentence"].endswith("the disk is nearly full")


def test_a_reference_counts_from_the_request_on(settings: Settings, store: Store) -> None:
    """A tracker that ran all the time has angles of the pre-roll too; another take may hold those frames."""
    with open_router([settings.zenoh]), capturing(settings), recording_thread(settings):
        captured(settings, 250)
        asked = store.recordings.request(GLOVE, name="all day")
        recorded(store, asked.id, 100)
        record = finished(store, asked.id)
    bare = store.takes.load(record.facts["take"])
    store.takes.attach_reference(
        record.facts["take"], bare.time_s, ["I_MCP"], 0.3 * bare.readings[:, :1], [""] * len(bare.time_s)
    )
    take = store.takes.load(record.facts["take"])
    known = np.isfinite(take.reference_at_frames(["I_MCP"])[:, 0])
    assert known.tolist() == [t >= take.start_s for t in take.time_s]
    assert known.sum() == record.facts["recorded"]


@pytest.mark.parametrize("lead_s", [-1.0, 601.0, float("nan")])
def test_a_pre_roll_that_cannot_be_is_refused(store: Store, lead_s: float) -> None:
    with pytest.raises(BadInput, match="0 to 600 s"):
        store.recordings.request(GLOVE, name="x", lead_s=lead_s)
