"""The pose subscriber: newest pose, names, silence, gaps, damage, and readers that are slow or fail."""

from __future__ import annotations

import json
import logging
import threading
from collections.abc import Iterator
from contextlib import ExitStack

import numpy as np
import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st
from loopback import eventually, free_endpoint

from glovecal_client import (
    GloveKeys,
    NoAnswer,
    Pose,
    PoseFlag,
    PoseSubscriber,
    encode_pose,
    open_client,
    open_router,
)
from glovecal_client.pose_subscriber import PoseOrder

KEYS = GloveKeys("lab", "g1")
MODEL = "ab" * 32


def pose(sequence: int, *, run_id: int = 1, skipped: int = 0, flags: int = 0, model: str = MODEL) -> Pose:
    degrees = np.array([sequence, -sequence], np.float32)
    ones = np.ones(2, np.float32)
    return Pose(
        sequence, run_id, sequence, 0, degrees, ones, np.zeros(2, np.uint8), model, flags, skipped=skipped
    )


class Service:
    """The service's side: publishes poses and says what the rotations are."""

    def __init__(self, session: zenoh.Session, endpoint: str) -> None:
        self.session = session
        self.endpoint = endpoint
        self.meta = {"model": MODEL, "rotations": ["I_MCP", "I_PIP"], "state": "calibrated"}
        self._queryable = session.declare_queryable(KEYS.pose_meta, self._answer)

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            query.reply(KEYS.pose_meta, json.dumps(self.meta))

    def put(self, item: Pose) -> None:
        self.session.put(KEYS.pose, encode_pose(item))


@pytest.fixture
def service() -> Iterator[Service]:
    endpoint = free_endpoint()
    with open_router([endpoint]) as router:
        yield Service(router, endpoint)


@pytest.fixture
def client(service: Service) -> Iterator[zenoh.Session]:
    with open_client([service.endpoint]) as session:
        yield session


def first_pose(service: Service, poses: PoseSubscriber) -> Pose:
    """Publish pose 0 until it arrives: a subscription takes a moment to reach the router."""

    def heard() -> Pose | None:
        service.put(pose(0))
        return poses.wait(0.05)

    return eventually(heard, "the first pose")


def test_newest_pose_is_given_once_and_named(service: Service, client: zenoh.Session) -> None:
    with PoseSubscriber(client, "lab", "g1") as poses:
        assert poses.stale
        assert poses.latest is None
        assert poses.wait(0.01) is None
        got = first_pose(service, poses)
        assert poses.angles(got) == {"I_MCP": 0.0, "I_PIP": 0.0}
        for sequence in range(1, 6):
            service.put(pose(sequence))
        eventually(lambda: poses.latest and poses.latest.sequence == 5, "pose 5")
        assert not poses.stale
        newest = poses.wait(1)
        assert newest is not None
        assert poses.angles(newest) == {"I_MCP": 5.0, "I_PIP": -5.0}
        assert poses.wait(0.01) is None


def test_silence_makes_it_stale(service: Service, client: zenoh.Session) -> None:
    with PoseSubscriber(client, "lab", "g1", stale_after_s=0.1) as poses:
        first_pose(service, poses)
        eventually(lambda: poses.stale, "silence is noticed")
        service.put(pose(1))
        eventually(lambda: not poses.stale, "a new pose ends it")
        service.put(pose(1, flags=PoseFlag.STALE))
        eventually(lambda: poses.latest and poses.latest.stale, "the service says that it is stale")
        assert poses.stale


def test_a_stale_pose_from_before_is_shown_but_is_no_frame_of_now() -> None:
    order = PoseOrder()
    assert order.accept(pose(41, run_id=1, flags=PoseFlag.STALE))
    assert not order.accept(pose(41, run_id=1, flags=PoseFlag.STALE))
    assert order.counts().received == 0
    for sequence in range(3):
        assert order.accept(pose(sequence, run_id=2))
    assert (order.counts().received, order.counts().lost) == (3, 0)


def test_names_follow_the_model_of_the_pose(service: Service, client: zenoh.Session) -> None:
    with PoseSubscriber(client, "lab", "g1") as poses:
        assert poses.rotations(first_pose(service, poses)) == ("I_MCP", "I_PIP")
        other = pose(1, model="cd" * 32)
        with pytest.raises(NoAnswer, match="names given are for model 'abab"):
            poses.rotations(other)
        service.meta = {"model": "cd" * 32, "rotations": ["T_MCP", "T_IP"]}
        assert poses.rotations(other) == ("T_MCP", "T_IP")
        service.meta = {"model": "ef" * 32, "rotations": ["T_MCP"]}
        with pytest.raises(NoAnswer, match="with 2 rotations"):
            poses.rotations(pose(2, model="ef" * 32))
        uncalibrated = Pose(3, 1, 0, 0, flags=PoseFlag.UNCALIBRATED)
        assert poses.angles(uncalibrated) == {}


def test_without_a_service_the_names_are_a_failure_not_a_guess() -> None:
    endpoint = free_endpoint()
    with (
        open_router([endpoint]),
        open_client([endpoint]) as client,
        PoseSubscriber(client, "lab", "g1") as poses,
        pytest.raises(NoAnswer, match="nobody answered"),
    ):
        poses.rotations(pose(0), timeout_s=1)


def test_damaged_repeated_and_lost_poses_are_counted(service: Service, client: zenoh.Session) -> None:
    with PoseSubscriber(client, "lab", "g1") as poses:
        first_pose(service, poses)
        message = encode_pose(pose(1))
        for damaged in (b"", message[:-1], message[:50] + b"\xff" + message[51:], message + b"\0"):
            service.session.put(KEYS.pose, damaged)
        eventually(lambda: poses.counts.damaged == 4, "all of them, after every first pose that was sent")
        repeated = poses.counts.repeated
        for item in (pose(1), pose(1), pose(0), pose(5, skipped=2), pose(6, skipped=2), pose(0, run_id=2)):
            service.put(item)
        eventually(lambda: poses.counts.runs == 2, "the second run")
        counts = poses.counts
        assert (counts.damaged, counts.repeated - repeated) == (4, 2)
        assert (counts.received, counts.skipped, counts.lost) == (5, 2, 1)


def test_slow_and_failing_callback_gets_the_newest_pose_and_blocks_nobody(
    service: Service, client: zenoh.Session, caplog: pytest.LogCaptureFixture
) -> None:
    seen: list[int] = []
    entered, go_on = threading.Event(), threading.Event()

    def on_pose(item: Pose) -> None:
        seen.append(item.sequence)
        entered.set()
        assert go_on.wait(120)
        if item.sequence == 0:
            raise RuntimeError("the tool's own mistake")

    other: list[int] = []
    keep = client.declare_subscriber("glovecal/lab/g2/pose", lambda sample: other.append(1))
    with caplog.at_level(logging.ERROR), PoseSubscriber(client, "lab", "g1", on_pose=on_pose) as poses:
        eventually(lambda: service.put(pose(0)) or entered.is_set(), "the first call")
        for sequence in range(1, 1001):
            service.put(pose(sequence))
            service.session.put("glovecal/lab/g2/pose", b"x")
        eventually(lambda: poses.latest and poses.latest.sequence == 1000, "pose 1000 has arrived")
        eventually(lambda: len(other) == 1000, "another subscription was not held up")
        go_on.set()
        eventually(lambda: seen[-1] == 1000, "the newest pose is given")
    keep.undeclare()
    assert seen == [0, 1000]
    assert "the tool's own mistake" in caplog.text


def test_subscriber_comes_back_with_the_router() -> None:
    endpoint = free_endpoint()
    with ExitStack() as longer_than_the_router:
        with open_router([endpoint]) as router:
            client = longer_than_the_router.enter_context(open_client([endpoint]))
            poses = longer_than_the_router.enter_context(
                PoseSubscriber(client, "lab", "g1", stale_after_s=0.2)
            )
            first_pose(Service(router, endpoint), poses)
        eventually(lambda: poses.stale, "silence is noticed")
        with open_router([endpoint]) as router:
            service = Service(router, endpoint)
            eventually(lambda: service.put(pose(7)) or poses.counts.received == 2, "pose 7")
            assert poses.angles(pose(7)) == {"I_MCP": 7.0, "I_PIP": -7.0}


def test_closing_ends_the_iteration(service: Service, client: zenoh.Session) -> None:
    poses = PoseSubscriber(client, "lab", "g1")
    seen: list[int] = []
    reader = threading.Thread(target=lambda: seen.extend(item.sequence for item in poses))
    reader.start()
    eventually(lambda: service.put(pose(0)) or poses.counts.received, "a pose")
    poses.close()
    reader.join(120)
    assert not reader.is_alive()
    assert set(seen) <= {0}
    poses.close()


@given(
    st.lists(st.tuples(st.integers(1, 4), st.booleans()), min_size=1, max_size=50),
    st.data(),
)
def test_received_skipped_and_lost_add_up(steps: list[tuple[int, bool]], data: st.DataObject) -> None:
    order = PoseOrder()
    assert order.accept(pose(0))
    sequence = skipped = lost = 0
    for step, lose in steps:
        sequence += step
        if lose:
            lost += step - 1
        else:
            skipped += step - 1
        assert order.accept(pose(sequence, skipped=skipped))
        assert not order.accept(pose(data.draw(st.integers(0, sequence)), skipped=skipped))
    counts = order.counts()
    assert (counts.received, counts.skipped, counts.lost) == (len(steps) + 1, skipped, lost)
    assert counts.received + counts.skipped + counts.lost == sequence + 1
    assert counts.repeated == len(steps)


def test_late_poses_of_a_process_that_lost_the_glove_are_dropped() -> None:
    def pose(sequence: int, term: int, at_s: float | None = None) -> Pose:
        at_ns = round(1e9 * (sequence / 120 if at_s is None else at_s))
        return Pose(sequence, 1, at_ns, at_ns, term=term)

    order = PoseOrder()
    taken = [order.accept(each) for each in (
        pose(0, 5), pose(1, 5),
        pose(2, 9), pose(2, 5), pose(3, 5), pose(3, 9),  # both for a moment: each frame once
        pose(4, 5), pose(4, 5), pose(5, 5), pose(6, 5), pose(4, 9),
        pose(120, 5), pose(400, 5, at_s=1.2), pose(401, 5, at_s=1.3),  # the other is gone for good
    )]  # fmt: skip
    assert taken == [
        True,
        True,
        True,
        False,
        False,
        True,
        False,
        False,
        False,
        False,
        True,
        False,
        True,
        True,
    ]
    assert order.counts().repeated == 7


def test_poses_go_on_when_the_numbers_of_the_glove_begin_again() -> None:
    """A glove restarted without a new run id, and one whose numbers jumped: nothing of that is lost."""
    order = PoseOrder()
    assert all(order.accept(pose(number)) for number in range(100, 110))
    assert [order.accept(pose(number)) for number in (3, 109, 3, 4, 4)] == [False] * 5
    assert not order.accept(pose(5))
    assert all(order.accept(pose(number)) for number in (6, 7, 8, 10**12, 10**12 + 1))
    counts = order.counts()
    assert (counts.received, counts.repeated, counts.lost) == (15, 6, 0)
