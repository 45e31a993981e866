"""Messages that wait outside of Python: when they came, which are kept, and a wait that ends."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
import zenoh
from realtime_support import eventually, free_endpoint

from glovecal_client.keys import all_gloves
from glovecal_client.session import open_client, open_router
from glovecal_service.incoming.arrivals import Arrival, Arrivals

RAW = all_gloves("lab", "raw")


@pytest.fixture
def sessions() -> Iterator[tuple[zenoh.Session, zenoh.Session]]:
    endpoint = free_endpoint()
    with open_router([endpoint]) as router, open_client([endpoint]) as client:
        yield router, client


def all_of(arrivals: Arrivals, count: int) -> list[Arrival]:
    taken: list[Arrival] = []
    eventually(lambda: taken.extend(arrivals.drain()) or len(taken) >= count, "the messages came")
    return taken


def test_a_message_is_as_old_as_its_receipt_however_late_it_is_taken(
    sessions: tuple[zenoh.Session, zenoh.Session],
) -> None:
    router, client = sessions
    arrivals = Arrivals(router, RAW)
    started = time.monotonic_ns()
    client.put("glovecal/lab/g1/raw", b"one")
    (first,) = all_of(arrivals, 1)
    between = time.monotonic_ns()
    client.put("glovecal/lab/g1/raw", b"two")
    time.sleep(0.5)
    slept = time.monotonic_ns()
    (second,) = arrivals.drain()
    assert (first.payload, second.payload) == (b"one", b"two")
    assert started <= first.received_ns <= between <= second.received_ns < slept
    arrivals.close()


def test_a_stamp_of_another_clock_is_not_believed(sessions: tuple[zenoh.Session, zenoh.Session]) -> None:
    router, client = sessions
    arrivals = Arrivals(router, RAW)
    (stamp_of_yesterday,) = [zenoh.Timestamp.parse_rfc3339("2020-01-01T00:00:00Z/33")]
    before = time.monotonic_ns()
    client.put("glovecal/lab/g1/raw", b"one", timestamp=stamp_of_yesterday)
    (taken,) = all_of(arrivals, 1)
    assert before <= taken.received_ns <= time.monotonic_ns()
    arrivals.close()


def test_where_more_come_than_can_wait_the_newest_are_kept(
    sessions: tuple[zenoh.Session, zenoh.Session],
) -> None:
    router, client = sessions
    arrivals, other = Arrivals(router, RAW, limit=4), Arrivals(router, RAW)
    for number in range(10):
        client.put("glovecal/lab/g1/raw", str(number))
    all_of(other, 10)
    assert [int(item.payload) for item in arrivals.drain()] == [6, 7, 8, 9]
    arrivals.close()
    other.close()


def test_a_wait_ends_without_a_message_and_with_the_first(
    sessions: tuple[zenoh.Session, zenoh.Session],
) -> None:
    router, client = sessions
    arrivals = Arrivals(router, RAW)
    assert arrivals.wait() is None
    client.put("glovecal/lab/g1/raw", b"one")
    found = eventually(arrivals.wait, "the message came")
    assert (found.key, found.payload) == ("glovecal/lab/g1/raw", b"one")
    assert arrivals.drain() == []
    arrivals.close()


def test_one_glove_alone_can_be_listened_to_and_waited_for(
    sessions: tuple[zenoh.Session, zenoh.Session],
) -> None:
    router, client = sessions
    arrivals = Arrivals(client, "glovecal/lab/g1/raw")
    found = eventually(
        lambda: router.put("glovecal/lab/g1/raw", b"one") or arrivals.drain(), "the router knows who listens"
    )
    assert {item.payload for item in found} == {b"one"}
    eventually(lambda: arrivals.wait() is None, "nothing more came")
    assert arrivals.drain() == []
    arrivals.close()


def test_what_waits_at_the_end_can_still_be_taken(sessions: tuple[zenoh.Session, zenoh.Session]) -> None:
    router, client = sessions
    arrivals, other = Arrivals(router, RAW), Arrivals(router, RAW)
    client.put("glovecal/lab/g1/raw", b"one")
    all_of(other, 1)
    arrivals.close()
    assert [item.payload for item in arrivals.drain()] == [b"one"]
    assert arrivals.drain() == []
    arrivals.close()
    other.close()
