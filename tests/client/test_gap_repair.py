"""Answers to gap-repair queries that are damaged, foreign or out of order are refused."""

from __future__ import annotations

import struct
from collections.abc import Iterator

import numpy as np
import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st
from loopback import free_endpoint

from glovecal_client import Frame, NoAnswer, WireError, encode_frame, fetch_frames, open_router
from glovecal_client.gap_repair import split_frames


def block(*sequences: int, run_id: int = 7) -> bytes:
    messages = [encode_frame(Frame(s, run_id, s, 0, np.zeros(2, np.float32))) for s in sequences]
    return b"".join(struct.pack("<I", len(message)) + message for message in messages)


@pytest.fixture(scope="module")
def session() -> Iterator[zenoh.Session]:
    with open_router([free_endpoint()]) as router:
        yield router


def fetched(session: zenoh.Session, reply: bytes) -> list[int]:
    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply("glovecal/lab/g1/log", reply)

    queryable = session.declare_queryable("glovecal/lab/g1/log", answer)
    try:
        return [frame.sequence for frame in fetch_frames(session, "lab", "g1", 7, 10, 13)]
    finally:
        queryable.undeclare()


def test_good_answer_is_taken(session: zenoh.Session) -> None:
    assert fetched(session, block(10, 11, 12, 13)) == [10, 11, 12, 13]


@pytest.mark.parametrize(
    "reply",
    [
        block(9, 10),
        block(11, 10),
        block(10, 10),
        block(13, 14),
        block(10, run_id=8),
        block(10, 11)[:-1],
        block(10) + b"\1",
        block(10)[:4] + b"GLVX" + block(10)[8:],
        struct.pack("<I", 0xFFFFFFFF) + b"x" * 100,
    ],
)
def test_bad_answer_is_refused(session: zenoh.Session, reply: bytes) -> None:
    with pytest.raises(WireError):
        fetched(session, reply)


def test_empty_answer_is_an_error(session: zenoh.Session) -> None:
    with pytest.raises(NoAnswer, match="no frames 10 to 13"):
        fetched(session, b"")


def test_asking_for_nothing_is_an_error(session: zenoh.Session) -> None:
    with pytest.raises(NoAnswer, match="nothing to fetch"):
        fetch_frames(session, "lab", "g1", 7, 5, 4)


@given(st.binary(max_size=300))
def test_arbitrary_blocks_are_refused_or_empty(data: bytes) -> None:
    try:
        assert split_frames(data) == []
    except WireError:
        return
