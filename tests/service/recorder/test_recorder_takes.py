"""Recordings with the real capture daemon: exact accounts through outages, kill -9 and a full disk."""

from __future__ import annotations

import itertools
import re
import subprocess
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from realtime_support import LAYOUT, WireGlove, eventually, part_of_service
from recorder_support import GLOVE, capturing, goes_on, recording_thread

from glovecal_client.session import open_client, open_router
from glovecal_service.serve import recorder
from glovecal_service.settings import Settings
from glovecal_service.store import Store
from glovecal_service.store.records import RecordingRecord


def frames(store: Store, id: str, at_least: int) -> Callable[[], RecordingRecord | None]:
    def enough() -> RecordingRecord | None:
        record = store.recordings.get(id)
        return record if record.facts.get("recorded", 0) >= at_least else None

    return enough


def sentence(store: Store, id: str) -> str:
    return store.recordings.get(id).facts.get("sentence", "")


def finished(store: Store, id: str) -> RecordingRecord:
    eventually(lambda: not store.recordings.get(id).is_open, "the end of the recording")
    return store.recordings.get(id)


def settled(store: Store, id: str) -> RecordingRecord:
    eventually(lambda: store.recordings.get(id).state in ("done", "failed"), "nothing is left to repair")
    return store.recordings.get(id)


def check_exact(store: Store, record: RecordingRecord) -> None:
    """Sent is recorded plus missing, by counts and by ranges; the take holds what was recorded."""
    facts = record.facts
    assert record.state == "done", facts
    assert facts["complete"] is True
    assert facts["pending"] == []
    assert facts["sent"] == facts["recorded"] + facts["missing_frames"]
    assert facts["missing_frames"] == sum(last - first + 1 for first, last in facts["missing"])
    take = store.takes.load(facts["take"])
    assert len(take.time_s) == facts["recorded"] + facts["pre_roll"]["frames"]
    kept = store.takes.get(facts["take"])
    assert (kept.recording, kept.state) == (record.id, "complete")


def test_a_recording_becomes_a_take_with_nothing_missing(settings: Settings, store: Store) -> None:
    with open_router([settings.zenoh]), capturing(settings, settings.data), recording_thread(settings):
        asked = store.recordings.request(GLOVE, name="walk")
        eventually(frames(store, asked.id, 150), "150 frames")
        store.recordings.stop(asked.id)
        record = finished(store, asked.id)
    check_exact(store, record)
    assert record.facts["missing"] == []
    assert record.facts["sent"] == record.facts["last_sequence"] - record.facts["first_sequence"] + 1
    kept = store.takes.get(record.facts["take"])
    assert (kept.subject, kept.layout, kept.wearing, kept.simulated) == ("anna", LAYOUT.name, "morning", True)
    take = store.takes.load(kept.id)
    assert take.sensors == LAYOUT.sensors
    np.testing.assert_allclose(take.context["supply_v"], 4.9, rtol=1e-6)
    assert abs(take.time_s[-1] - time.monotonic()) < 60
    assert kept.accounting is not None
    assert abs(kept.accounting["wall_minus_time_s"] - (time.time() - time.monotonic())) < 1.0


def test_a_recording_asked_for_before_capture_is_there_learns_its_sensors(
    settings: Settings, store: Store
) -> None:
    with open_router([settings.zenoh]), recording_thread(settings):
        asked = store.recordings.request(GLOVE, name="early")
        eventually(lambda: store.recordings.get(asked.id).state == "recording", "it waits for frames")
        with capturing(settings):
            eventually(frames(store, asked.id, 20), "20 frames")
            store.recordings.stop(asked.id)
            record = finished(store, asked.id)
    check_exact(store, record)
    assert store.takes.load(record.facts["take"]).sensors == LAYOUT.sensors


def test_frames_missed_while_the_router_was_away_are_repaired(settings: Settings, store: Store) -> None:
    with ExitStack() as running:
        router = running.enter_context(ExitStack())
        router.enter_context(open_router([settings.zenoh]))
        running.enter_context(capturing(settings, settings.data))
        running.enter_context(recording_thread(settings))
        asked = store.recordings.request(GLOVE, name="outage")
        eventually(frames(store, asked.id, 60), "60 frames")
        router.close()
        goes_on(settings, 100)
        running.enter_context(open_router([settings.zenoh]))
        eventually(
            lambda: store.recordings.get(asked.id).facts.get("repaired", 0) > 50,
            "frames from the log",
        )
        store.recordings.stop(asked.id)
        record = finished(store, asked.id)
    check_exact(store, record)
    assert record.facts["missing"] == []
    assert record.facts["repaired"] > 50


def test_what_capture_cannot_be_asked_for_is_pending(settings: Settings, store: Store) -> None:
    """Nobody answers for the log: the take can be used, and says which frames are not in it yet."""
    with open_router([settings.zenoh]), open_client([settings.zenoh]) as session, recording_thread(settings):
        glove = WireGlove(session, settings, GLOVE, subject="anna")
        store.gloves.seen(GLOVE, {"layout": LAYOUT.name, "sensors": list(LAYOUT.sensors), "subject": "anna"})
        asked = store.recordings.request(GLOVE, name="lossy")
        eventually(lambda: store.recordings.get(asked.id).state == "recording", "recording began")
        for sequence in [*range(10, 20), *range(25, 30), 31, 31, 28]:
            glove.send(sequence=sequence)
            time.sleep(0.002)
        glove.send_bytes(b"GLVF damaged")
        eventually(frames(store, asked.id, 16), "16 frames")
        store.recordings.stop(asked.id)
        record = finished(store, asked.id)
    assert (record.state, store.takes.get(record.facts["take"]).state) == ("repairing", "repairing")
    assert (record.facts["pending"], record.facts["pending_frames"]) == ([[20, 24], [30, 30]], 6)
    assert (record.facts["missing"], record.facts["missing_frames"]) == ([], 0)
    assert (record.facts["sent"], record.facts["recorded"], record.facts["refused"]) == (22, 16, 1)
    assert len(store.takes.load(record.facts["take"]).time_s) == 16
    assert "incomplete, repairing: " in sentence(store, asked.id)
    assert "6 still to be fetched from the capture log" in sentence(store, asked.id)
    assert record.facts["pre_roll"]["frames"] == 0
    assert "capture's log did not give more: " in record.facts["pre_roll"]["sentence"]


def test_numbers_that_no_glove_can_have_reached_are_not_sent(settings: Settings, store: Store) -> None:
    """One wild number is refused; a publisher that goes on elsewhere loses no frame, and leaves no gap."""
    with open_router([settings.zenoh]), open_client([settings.zenoh]) as session, recording_thread(settings):
        glove = WireGlove(session, settings, GLOVE, subject="anna")
        store.gloves.seen(GLOVE, {"layout": LAYOUT.name, "sensors": list(LAYOUT.sensors), "subject": "anna"})
        asked = store.recordings.request(GLOVE, name="wild")
        eventually(lambda: store.recordings.get(asked.id).state == "recording", "recording began")
        sent = 0

        def recorded() -> int:
            return store.recordings.get(asked.id).facts.get("recorded", 0)

        def goes_on(begins_at: int) -> Callable[[], bool]:
            """The glove sends on from there, a few frames a look, until these are recorded too."""
            numbers, before = itertools.count(begins_at), sent

            def send_some() -> bool:
                nonlocal sent
                for _ in range(10):
                    glove.send(sequence=next(numbers))
                    time.sleep(0.005)
                sent += 10
                time.sleep(0.1)
                return recorded() > before

            return send_some

        for wild, begins_at in ((999_999_999, 100), (2**64 - 1, 5_000_000), (10**12, 0)):
            eventually(goes_on(begins_at), f"the frames from {begins_at} on are recorded")
            eventually(lambda: recorded() == sent, "all of them")
            glove.send(sequence=wild)
        stopped_at = time.monotonic()
        store.recordings.stop(asked.id)
        record = finished(store, asked.id)
    assert time.monotonic() - stopped_at < 30
    assert record.state == "repairing", "no capture daemon says that nothing came after the last frame"
    assert (record.facts["sent"], record.facts["recorded"], record.facts["refused"]) == (sent, sent, 3)
    assert (record.facts["first_sequence"], record.facts["pending"]) == (100, [])
    assert len(store.takes.load(record.facts["take"]).time_s) == sent


def test_a_killed_recorder_goes_on_and_fetches_what_it_missed(settings: Settings, store: Store) -> None:
    with open_router([settings.zenoh]), capturing(settings, settings.data):
        with part_of_service(recorder, settings) as process:
            asked = store.recordings.request(GLOVE, name="killed")
            eventually(frames(store, asked.id, 100), "100 frames")
            process.kill()
            process.join()
        with (settings.recordings_folder / f"{asked.id}.glog").open("ab") as file:
            file.write(b"\x20\x00\x00\x00half a record")
        with recording_thread(settings):
            before = store.recordings.get(asked.id).facts["recorded"]
            eventually(frames(store, asked.id, before + 100), "100 frames more")
            store.recordings.stop(asked.id)
            record = finished(store, asked.id)
    check_exact(store, record)
    assert record.facts["missing"] == []
    assert record.facts["repaired"] > 0
    assert len(record.facts["interruptions"]) == 1


def test_stopping_without_a_single_frame_fails_with_a_sentence(settings: Settings, store: Store) -> None:
    with open_router([settings.zenoh]), recording_thread(settings):
        asked = store.recordings.request(GLOVE, name="nothing")
        eventually(lambda: store.recordings.get(asked.id).state == "recording", "recording began")
        store.recordings.stop(asked.id)
        record = finished(store, asked.id)
    assert record.state == "failed"
    assert "no frame of glove g1 arrived" in record.facts["sentence"]


@pytest.fixture
def small_disk(settings: Settings, store: Store, mount_small_disk: Callable[..., None]) -> Path:
    """The recordings folder on a disk of 40 kB."""
    mount_small_disk(settings.recordings_folder, "40k")
    return settings.recordings_folder


def test_a_full_disk_is_said_and_what_was_recorded_stays(
    settings: Settings, store: Store, small_disk: Path
) -> None:
    with open_router([settings.zenoh]), capturing(settings, settings.data), recording_thread(settings):
        asked = store.recordings.request(GLOVE, name="full")
        eventually(lambda: "frames wait in memory" in sentence(store, asked.id), "the sentence")
        assert re.search("no room|No space left", sentence(store, asked.id))
        goes_on(settings, 100)
        store.recordings.stop(asked.id)
        record = finished(store, asked.id)
        assert record.state == "repairing"
        assert record.facts["pending_frames"] > 0
        assert "the disk is full" in record.facts["sentence"]
        kept = store.takes.get(record.facts["take"])
        assert kept.frames == record.facts["recorded"] + record.facts["pre_roll"]["frames"] > 100
        subprocess.run(["mount", "-o", "remount,size=4m", str(small_disk)], check=True)
        record = settled(store, asked.id)
    check_exact(store, record)
    assert record.facts["missing"] == []
