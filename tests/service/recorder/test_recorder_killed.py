"""kill -9 of the recorder, and the stop before it is back: every frame captured is in the account."""

from __future__ import annotations

import signal
import subprocess
import time

import numpy as np
import pytest
from realtime_support import eventually, part_of_service
from recorder_support import (
    GLOVE,
    capture_process,
    capturing,
    goes_on,
    logged,
    recording_thread,
)

from glovecal_client import Recording
from glovecal_client.session import open_router
from glovecal_service.serve import recorder
from glovecal_service.settings import Settings
from glovecal_service.store import Store
from glovecal_service.store.records import RecordingRecord


def begun(store: Store, name: str) -> str:
    asked = store.recordings.request(GLOVE, name=name, lead_s=0)
    eventually(lambda: store.recordings.get(asked.id).state == "recording", "it is recorded")
    return asked.id


def settled(store: Store, id: str) -> RecordingRecord:
    eventually(lambda: store.recordings.get(id).state in ("done", "failed"), "nothing is left to repair")
    return store.recordings.get(id)


def check_law(settings: Settings, record: RecordingRecord, stopped_ns: int) -> None:
    """What was numbered up to the stop is recorded or missing; nothing that is logged is missing."""
    facts = record.facts
    assert (record.state, facts["complete"], facts["pending"]) == ("done", True, []), facts
    frames = [frame for log in logged(settings) for frame in Recording.open(log).frames()]
    in_log = {(frame.run_id, frame.sequence): frame.wall_ns for frame in frames}
    file = settings.recordings_folder / facts["file"]
    recorded = {(frame.run_id, frame.sequence) for frame in Recording.open(file).frames()}
    missing = {
        (int(run["run_id"], 16), number)
        for run in facts["runs"]
        for first, last in run["missing"]
        for number in range(first, last + 1)
    }
    assert not missing & set(in_log)
    begins_ns = in_log[int(facts["runs"][0]["run_id"], 16), facts["first_sequence"]]
    due = {key for key, wall_ns in in_log.items() if begins_ns <= wall_ns <= stopped_ns}
    assert due <= recorded | missing
    assert facts["sent"] == facts["recorded"] + facts["missing_frames"] == len(recorded) + len(missing)


@pytest.mark.parametrize(("recorded", "away"), [(0, 0), (100, 80)])
def test_stopped_while_the_recorder_is_away(
    settings: Settings, store: Store, recorded: int, away: int
) -> None:
    with open_router([settings.zenoh]), capturing(settings):
        with part_of_service(recorder, settings) as process:
            id = begun(store, "killed")
            goes_on(settings, recorded)
            process.kill()
            process.join()
        goes_on(settings, away)
        stopped_ns = time.time_ns()
        store.recordings.stop(id)
        goes_on(settings, 60)
        with recording_thread(settings):
            record = settled(store, id)
    check_law(settings, record, stopped_ns)
    assert record.facts["missing"] == []
    in_log = len(list(Recording.open(logged(settings)[-1]).frames()))
    assert record.facts["last_sequence"] < in_log - 1, "what came after the stop is not asked for"


def kill(process: subprocess.Popen[bytes]) -> None:
    process.send_signal(signal.SIGKILL)
    process.wait()


def test_while_capture_is_away_too_it_is_incomplete_and_repaired_as_soon_as_it_is_back(
    settings: Settings, store: Store
) -> None:
    """Recorder and capture killed; another run of capture begins before the stop, a third one comes later."""
    with open_router([settings.zenoh]):
        with capture_process(settings) as capture:
            goes_on(settings, 1)  # it can say its sensors before the recording begins
            with part_of_service(recorder, settings) as process:
                id = begun(store, "both killed")
                goes_on(settings, 80)
                process.kill()
                process.join()
            goes_on(settings, 60)
            kill(capture)
        with capture_process(settings) as capture:
            eventually(lambda: len(logged(settings)) == 2, "a second run")
            goes_on(settings, 60)
            stopped_ns = time.time_ns()
            store.recordings.stop(id)
            goes_on(settings, 60)
            kill(capture)
        with recording_thread(settings):
            eventually(lambda: store.recordings.get(id).state == "repairing", "it says so")
        record = store.recordings.get(id)
        assert record.facts["sentence"].startswith("incomplete, repairing: ")
        take = store.takes.get(record.facts["take"])
        assert take.state == "repairing"
        before = store.takes.load(take.id)
        store.takes.attach_reference(take.id, before.time_s, ["I_MCP"], np.ones((len(before.time_s), 1)))
        with capture_process(settings), recording_thread(settings):
            record = settled(store, id)
    check_law(settings, record, stopped_ns)
    assert (record.facts["missing"], len(record.facts["runs"])) == ([], 2)
    whole = store.takes.get(take.id)
    assert (whole.state, whole.frames) == ("complete", record.facts["recorded"])
    assert whole.frames > take.frames
    assert whole.reference_rows == take.frames
    repaired = store.takes.load(take.id)
    assert set(before.time_s) < set(repaired.time_s)
    np.testing.assert_array_equal(repaired.reference_time_s, before.time_s)


def test_capture_that_ended_by_itself_leaves_a_complete_take(settings: Settings, store: Store) -> None:
    """Its last status said how far it came; its log is compared once capture answers again."""
    with open_router([settings.zenoh]), recording_thread(settings):
        with capturing(settings):
            id = begun(store, "ended")
            goes_on(settings, 60)
        stopped_ns = time.time_ns()
        store.recordings.stop(id)
        eventually(lambda: store.recordings.get(id).state == "repairing", "capture's log to compare with")
        record = store.recordings.get(id)
        assert "0 missing; not compared with the capture log yet: " in record.facts["sentence"]
        assert store.takes.get(record.facts["take"]).state == "complete"
        with capturing(settings):
            record = settled(store, id)
    check_law(settings, record, stopped_ns)
    assert (record.facts["missing"], record.facts["compared"]) == ([], True)


def test_what_the_log_does_not_have_is_missing_for_good(settings: Settings, store: Store) -> None:
    with open_router([settings.zenoh]):
        with capture_process(settings) as capture:
            goes_on(settings, 1)  # it can say its sensors before the recording begins
            with part_of_service(recorder, settings) as process:
                id = begun(store, "log removed")
                goes_on(settings, 60)
                process.kill()
                process.join()
            goes_on(settings, 60)
            store.recordings.stop(id)
            kill(capture)
        logged(settings)[-1].unlink()
        with capture_process(settings), recording_thread(settings):
            record = settled(store, id)
    facts = record.facts
    assert record.state == "done"
    # on a busy computer frames are lost on the way, and the log that would have them is gone
    assert facts["recorded"] + facts["missing_frames"] == facts["sent"] > facts["missing_frames"]
    assert "the capture log cannot tell of all: " in record.facts["sentence"]
    assert "was not recorded here" in record.facts["sentence"]


def test_a_recording_stopped_before_it_began_says_so(settings: Settings, store: Store) -> None:
    asked = store.recordings.request(GLOVE, name="too short")
    store.recordings.stop(asked.id)
    with open_router([settings.zenoh]), recording_thread(settings):
        record = settled(store, asked.id)
    assert (record.state, record.facts["sentence"]) == (
        "failed",
        "recording too short was stopped before it began: nothing was recorded",
    )
