"""Every frame of a glove stands in the service's status: sent, received, missing, and what became of it."""

from __future__ import annotations

import json
import secrets
import threading
import time
from collections.abc import Iterator

import pytest
import zenoh
from realtime_support import WireGlove, eventually, free_endpoint, glove_status, part_of_service

from glovecal_client.session import open_client
from glovecal_service.serve import real_time
from glovecal_service.settings import Settings
from glovecal_service.store import Store


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> Settings:
    data = tmp_path_factory.mktemp("counts")
    settings = Settings(data=data, database=None, artifacts=None, zenoh=free_endpoint(), site="lab")
    Store.open(settings).close()
    return settings


@pytest.fixture(scope="module")
def session(settings: Settings) -> Iterator[zenoh.Session]:
    with part_of_service(real_time, settings), open_client([settings.zenoh], wait_s=20) as session:
        yield session


def checked(session: zenoh.Session, settings: Settings, glove: WireGlove) -> dict:
    """The glove's counts, which add up at any moment."""
    counts = glove_status(session, settings, glove.keys.glove)
    if counts:
        assert counts["sent"] == counts["received"] + counts["missing"]
        of_received = counts["predicted"] + counts["skipped"] + sum(counts["refused"].values())
        assert counts["received"] == of_received + counts["waiting"]
        assert min(counts["missing"], counts["waiting"]) >= 0
    return counts


def settled(session: zenoh.Session, settings: Settings, glove: WireGlove) -> dict:
    """The counts once all that was put on the glove's key is decided."""

    def done() -> dict | None:
        counts = checked(session, settings, glove)
        return counts if counts.get("received") == glove.sent and not counts["waiting"] else None

    return eventually(done, "every message decided")


def say_status(session: zenoh.Session, glove: WireGlove, sequence: int) -> None:
    """As the capture daemon: the last number given."""
    status = {"run_id": f"{glove.run_id:016x}", "sequence": sequence, "state": "streaming"}
    session.put(glove.keys.status, json.dumps(status), congestion_control=zenoh.CongestionControl.BLOCK)


def lose(glove: WireGlove, frames: int) -> None:
    """Frames that capture numbered, and that nobody ever gets."""
    glove.sequence += frames


def test_lost_damaged_and_repeated_frames_add_up_at_any_moment(
    session: zenoh.Session, settings: Settings
) -> None:
    glove = WireGlove(session, settings, "g-lossy")
    glove.sequence = 1000  # before the service listened

    def stream() -> None:
        for number in range(300):
            message = glove.send()
            if number % 10 == 3:
                lose(glove, 2)
            if number % 50 == 7:
                glove.send_bytes(message)
            if number % 100 == 9:
                glove.send_bytes(message[:-1])
                lose(glove, 1)  # this one: it arrived, damaged
            time.sleep(0.002)

    thread = threading.Thread(target=stream)
    thread.start()
    looks = 0
    while thread.is_alive():
        looks += bool(checked(session, settings, glove))
    thread.join()
    assert looks > 3
    counts = settled(session, settings, glove)
    assert counts["missing"] == 60
    assert counts["refused"] == {"duplicate": 6, "damaged": 3}
    assert counts["sent"] == 300 + 60 + 6 + 3
    assert counts["predicted"] + counts["skipped"] == 300


def test_frames_lost_at_the_end_of_a_run_and_at_the_beginning_of_the_next(
    session: zenoh.Session, settings: Settings
) -> None:
    glove = WireGlove(session, settings, "g-restarted")
    for _ in range(20):
        glove.send()
    lose(glove, 30)
    say_status(session, glove, glove.sequence - 1)
    eventually(lambda: checked(session, settings, glove).get("missing") == 30, "what capture says is missing")
    say_status(session, glove, 10**9)
    glove.run_id, glove.sequence = secrets.randbits(64), 0
    time.sleep(0.6)  # a run keeps its glove for half a second
    lose(glove, 5)
    for _ in range(10):
        glove.send()
    counts = settled(session, settings, glove)
    assert (counts["sent"], counts["received"], counts["missing"], counts["runs"]) == (65, 30, 35, 2)


def test_a_glove_of_which_no_frame_arrives_is_told(session: zenoh.Session, settings: Settings) -> None:
    glove = WireGlove(session, settings, "g-unheard")
    glove.say_meta()
    say_status(session, glove, 100)
    lose(glove, 121)
    say_status(session, glove, glove.sequence - 1)

    def missing() -> int:
        return checked(session, settings, glove).get("missing", 0)

    eventually(lambda: missing() == 20, "the frames since the service heard of it")
    glove.send()
    eventually(lambda: checked(session, settings, glove)["received"] == 1, "a frame")
    counts = settled(session, settings, glove)
    assert (counts["sent"], counts["received"], counts["missing"]) == (21, 1, 20)


def test_a_service_that_starts_again_counts_from_its_first_frame(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    data = tmp_path_factory.mktemp("again")
    settings = Settings(data=data, database=None, artifacts=None, zenoh=free_endpoint(), site="lab")
    Store.open(settings).close()
    run_id = secrets.randbits(64)
    for first in (0, 500):
        with part_of_service(real_time, settings), open_client([settings.zenoh], wait_s=20) as session:
            glove = WireGlove(session, settings, "g1")
            glove.run_id, glove.sequence = run_id, first
            glove.send()
            settled(session, settings, glove)  # a process that was busy just then counts from a later one
            for _ in range(9):
                glove.send()
            lose(glove, 4)
            glove.send()
            counts = settled(session, settings, glove)
            assert (counts["sent"], counts["received"], counts["missing"]) == (15, 11, 4)
