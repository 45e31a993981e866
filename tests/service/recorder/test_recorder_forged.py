"""Frames that look like the glove's and are not its capture's stay out of the take, and that is told."""

from __future__ import annotations

import dataclasses
import itertools
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
import zenoh
from realtime_support import eventually
from recorder_support import GLOVE, capturing, logged, recording_thread

from glovecal_client.capture.log_folder import LogQueries
from glovecal_client.errors import BadName
from glovecal_client.frame_log import Recording
from glovecal_client.keys import GloveKeys
from glovecal_client.session import open_client, open_router
from glovecal_client.wire.frame import Frame, decode_frame, encode_frame
from glovecal_service.settings import Settings
from glovecal_service.store import Store
from glovecal_service.store.records import RecordingRecord

WITHIN_S = 60.0


@contextmanager
def forging(settings: Settings) -> Iterator[list[Frame]]:
    """A stranger on the same network, who hears the glove and speaks in its name; what was put so far.

    One after another: the next frame before the glove sends it, a frame of a clock that runs ahead, a
    number far ahead, a replay, and the frame just heard with other readings.
    """
    forged: list[Frame] = []
    stopped = threading.Event()
    turn = itertools.count()
    keys = GloveKeys(settings.site, GLOVE)

    def lie(sample: zenoh.Sample) -> None:
        message = sample.payload.to_bytes()
        frame = decode_frame(message)
        at = next(turn)
        if stopped.is_set() or at % 10 or frame.readings[0] == 7.0:
            return
        lies = np.full(len(frame.readings), 7.0, np.float32)
        kinds = [
            {"sequence": frame.sequence + 1, "monotonic_ns": frame.monotonic_ns + 2_000_000},
            {"sequence": frame.sequence + 2, "monotonic_ns": frame.monotonic_ns + 100_000_000_000},
            {"sequence": frame.sequence + 500, "wall_ns": frame.wall_ns + 3_600_000_000_000},
            {},
        ]
        kind = (at // 10) % 5
        if kind == 4:
            session.put(keys.raw, message)
            return
        forged.append(dataclasses.replace(frame, readings=lies, **kinds[kind]))
        session.put(keys.raw, encode_frame(forged[-1]))

    with open_client([settings.zenoh], wait_s=20) as session:
        handler = zenoh.handlers.Callback(lie, indirect=True)
        subscriber = session.declare_subscriber(keys.raw, handler, allowed_origin=zenoh.Locality.REMOTE)
        try:
            yield forged
        finally:
            stopped.set()
            subscriber.undeclare()


def recorded_among_lies(settings: Settings, store: Store, name: str, lies: int = 25) -> RecordingRecord:
    asked = store.recordings.request(GLOVE, name=name)
    eventually(lambda: store.recordings.get(asked.id).facts.get("recorded", 0) > 20, "frames", WITHIN_S)
    with forging(settings) as forged:
        eventually(lambda: len(forged) >= lies, "enough lies", WITHIN_S)
    time.sleep(0.2)
    return asked


def ended(store: Store, asked: RecordingRecord, state: str) -> RecordingRecord:
    eventually(lambda: store.recordings.get(asked.id).state == state, state, WITHIN_S)
    return store.recordings.get(asked.id)


def check_is_the_captures(settings: Settings, store: Store, record: RecordingRecord) -> None:
    """The take is the capture log from its first frame to its last, and the raw recording has more."""
    facts = record.facts
    frames = [frame for log in logged(settings) for frame in Recording.open(log).frames()]
    truth = {(f"{frame.run_id:016x}", frame.sequence): frame for frame in frames}
    mine = [
        truth[run["run_id"], sequence]
        for run in facts["runs"]
        for sequence in range(run["first_sequence"], run["last_sequence"] + 1)
    ]
    assert (facts["sent"], facts["recorded"], facts["missing_frames"]) == (len(mine), len(mine), 0)
    assert facts["compared"] is True
    take = store.takes.load(facts["take"])
    asked_for = slice(facts["pre_roll"]["frames"], None)
    np.testing.assert_array_equal(take.readings[asked_for], [frame.readings for frame in mine])
    np.testing.assert_allclose(
        take.time_s[asked_for], [frame.monotonic_ns / 1e9 for frame in mine], rtol=0, atol=1e-6
    )
    raw = list(Recording.open(settings.recordings_folder / facts["file"]).frames())
    lies = [frame for frame in raw if frame.readings[0] == 7.0]
    assert len(lies) == facts["taken_out"] > 0
    assert f"{facts['taken_out']} frames were not the capture's and were taken out" in facts["sentence"]


def test_what_a_stranger_publishes_stays_out_of_the_take(settings: Settings, store: Store) -> None:
    with open_router([settings.zenoh]), capturing(settings), recording_thread(settings):
        asked = recorded_among_lies(settings, store, "lied-to")
        store.recordings.stop(asked.id)
        record = ended(store, asked, "done")
    check_is_the_captures(settings, store, record)


def test_a_capture_without_digests_is_asked_for_its_frames(
    settings: Settings, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer = LogQueries.answer

    def before_there_were_digests(self: LogQueries, parameters: str) -> bytes:
        if "digest" in parameters:
            raise BadName(f"log query {parameters!r} is not run=HEX16;from=A;to=B")
        return answer(self, parameters)

    monkeypatch.setattr(LogQueries, "answer", before_there_were_digests)
    with open_router([settings.zenoh]), capturing(settings), recording_thread(settings):
        asked = recorded_among_lies(settings, store, "old-capture", lies=8)
        store.recordings.stop(asked.id)
        record = ended(store, asked, "done")
    check_is_the_captures(settings, store, record)


def test_what_nobody_answers_for_is_compared_as_soon_as_capture_is_back(
    settings: Settings, store: Store
) -> None:
    with open_router([settings.zenoh]), recording_thread(settings):
        with capturing(settings):
            asked = recorded_among_lies(settings, store, "left-alone")
        store.recordings.stop(asked.id)
        record = ended(store, asked, "repairing")
        assert record.facts["compared"] is False
        assert record.facts["taken_out"] == 0
        with capturing(settings):
            record = ended(store, asked, "done")
    check_is_the_captures(settings, store, record)
