"""What is taken, what is skipped, and that the books balance."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from loop_by_hand import ByHand, LoopByHand, moving_frames
from realtime_support import linear_model

from glovecal_client.keys import GloveKeys
from glovecal_client.wire.frame import Frame, encode_frame
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_service.incoming.arrivals import Arrival, Arrivals
from glovecal_service.realtime.glove_lanes import (
    VALID_WITHIN_NS,
    WAITING_LIMIT,
    GlovePipeline,
    GlovePipelines,
)
from glovecal_service.realtime.lane_effects import WornGloves
from glovecal_service.realtime.pose_loop import PoseLoop
from glovecal_service.realtime.served_model import CAUTION, Pace, ServedModel, ServedModels

MILLISECOND = 1_000_000


def lane() -> GlovePipeline:
    return GlovePipeline(GloveKeys("lab", "g1"))


def test_all_waiting_frames_are_taken_when_there_is_room() -> None:
    it = lane()
    for at in range(5):
        it.add(b"m", at * MILLISECOND)
    assert [item.received_ns for item in it.newest(64, 0)] == [at * MILLISECOND for at in range(5)]
    assert it.skipped == 0


def test_with_little_room_the_newest_are_taken_and_the_rest_counted() -> None:
    it = lane()
    for at in range(10):
        it.add(b"m", at)
    assert [item.received_ns for item in it.newest(2, 0)] == [8, 9]
    assert (it.received, it.skipped) == (10, 8)


def test_frames_that_waited_too_long_are_skipped() -> None:
    it = lane()
    for at in (1, 2, 30, 31):
        it.add(b"m", at)
    assert [item.received_ns for item in it.newest(64, 30)] == [30, 31]
    assert it.skipped == 2


@given(
    st.lists(
        st.one_of(st.integers(1, 40), st.tuples(st.integers(1, 8), st.integers(0, 50))),
        min_size=1,
        max_size=40,
    )
)
def test_every_message_is_taken_skipped_or_waiting(steps: list[int | tuple[int, int]]) -> None:
    it, now, taken = lane(), 0, 0
    for step in steps:
        if isinstance(step, int):
            for _ in range(step):
                now += 1
                it.add(b"m", now)
        else:
            limit, age = step
            got = it.newest(limit, now - age)
            assert len(got) <= limit
            assert all(item.received_ns >= now - age for item in got)
            taken += len(got)
        assert len(it) <= WAITING_LIMIT
        assert it.received == taken + it.skipped + len(it)


def test_the_first_frames_of_a_run_are_counted_when_they_are_skipped() -> None:
    """A service that stood still while a capture began: frames before the first pose belong to its run."""

    def add(run_id: int, sequences: range) -> None:
        for sequence in sequences:
            readings = np.zeros(3, np.float32)
            at = run_id * 1000 * MILLISECOND + sequence
            frame = Frame(sequence=sequence, run_id=run_id, monotonic_ns=at, wall_ns=at, readings=readings)
            it.add(encode_frame(frame), at)

    def open_newest(limit: int) -> None:
        for waiting in it.newest(limit, 0):
            assert it.open(waiting) is not None

    it = lane()
    add(1, range(10))
    open_newest(4)
    assert it.skipped_in_run == 6
    add(1, range(10, 13))
    open_newest(1)
    assert it.skipped_in_run == 8
    add(2, range(5))
    open_newest(2)
    assert (it.skipped, it.skipped_in_run) == (11, 3)
    add(2, range(5, 7))
    open_newest(1)
    assert it.skipped_in_run == 4
    add(1, range(20, 24))  # nobody knows whose they are until one is looked into
    add(3, range(100, 101))
    open_newest(1)
    assert it.skipped_in_run == 4
    add(3, range(101, 104))
    add(4, range(1))
    open_newest(1)
    assert it.skipped_in_run == 0


def test_pace_starts_cautious_learns_quickly_and_forgives_one_slow_turn() -> None:
    pace = Pace()
    assert pace.frames_within(0.010) == 2
    pace.observe(4, 0.0004)
    assert pace.frames_within(0.010) in (99, 100)
    pace.observe(1, 0.050)
    assert pace.frames_within(0.010) >= 60
    for _ in range(20):
        pace.observe(1, 0.020)
    assert pace.frames_within(0.010) == 1


def test_pace_learns_from_small_turns_what_a_full_one_costs() -> None:
    """What a turn costs whatever is in it must not be taken for the cost of each of its frames."""
    pace = Pace(frame_s=50e-6, turn_s=300e-6)
    for _ in range(5):
        pace.observe(1, 2 * 350e-6)  # a computer half as fast as when it was measured
    assert pace.frames_within(0.010) in (93, 94)


@given(st.lists(st.tuples(st.integers(0, 100), st.floats(0, 10)), max_size=50))
def test_pace_always_lets_something_go_on(turns: list[tuple[int, float]]) -> None:
    pace = Pace()
    for frames, seconds in turns:
        pace.observe(frames, seconds)
        assert 1 <= pace.frames_within(0.010) <= 10_000


class CostlyPace(Pace):
    """A machine that needs 5 ms for a frame of this model; keeps how many frames each turn had."""

    def __init__(self) -> None:
        super().__init__(5e-3 / CAUTION)
        self.turns: list[int] = []

    def observe(self, frames: int, seconds: float) -> None:
        self.turns.append(frames)


class NeverEmpty(ByHand):
    """While the loop works, a frame of every glove arrives each turn, ``rounds`` times."""

    def __init__(self, gloves: int, rounds: int) -> None:
        super().__init__()
        self._gloves, self._rounds, self._sequence = gloves, rounds, 0

    def wait(self) -> Arrival | None:
        return self._arrivals().pop() if self._sequence == 0 else None

    def drain(self) -> list[Arrival]:
        return self._arrivals() if self._sequence < self._rounds else []

    def _arrivals(self) -> list[Arrival]:
        frames = [
            Frame(self._sequence, number + 1, self._sequence + 1, 0, np.full(3, 120.0, np.float32))
            for number in range(self._gloves)
        ]
        self._sequence += 1
        now = time.monotonic_ns()
        return [
            Arrival(GloveKeys("lab", f"g{frame.run_id}").raw, encode_frame(frame), now) for frame in frames
        ]


def overloaded(gloves: int, models: int) -> tuple[list[CostlyPace], list[GlovePipeline]]:
    """What a loop did that has 20 ms for a round, and frames of 5 ms each.

    It is seen to go on meanwhile, though frames wait all the time.
    """
    served = [
        replace(
            ServedModel.prepare(f"{number + 1:064x}", linear_model("anna", degrees_per_count=0.5)),
            pace=CostlyPace(),
        )
        for number in range(models)
    ]
    table = ServedModels()
    for number in range(gloves):
        table.put(f"g{number + 1}", served[number % models])
    loop = PoseLoop(
        cast(Arrivals, NeverEmpty(gloves, 24)), table, lambda *_: None, WornGloves(), oldest_ns=600 * 10**9,
        round_budget_s=0.020,
    )  # fmt: skip
    loop.step()
    assert loop.turns >= 20, "one call, many turns"
    return [cast(CostlyPace, model.pace) for model in served], loop.lanes


class Fails:
    """A predictor as a damaged model or a user's own regressor may have one."""

    def predict(self, readings: np.ndarray) -> None:
        raise RuntimeError("index 7 is out of bounds")


def test_a_model_that_fails_takes_no_other_glove_its_poses(caplog: pytest.LogCaptureFixture) -> None:
    by_hand = LoopByHand.serving(linear_model("anna", degrees_per_count=0.5))
    by_hand.serve("g2", linear_model("bert", degrees_per_count=0.25), number=2)
    served = by_hand.models.of("g2")
    assert served is not None
    by_hand.models.put("g2", replace(served, predictor=cast(GlovePredictor, Fails())))
    frames = moving_frames(20)
    by_hand.send((glove, frame) for frame in frames for glove in ("g1", "g2"))
    assert len(by_hand.poses["g1"]) == 20
    assert "g2" not in by_hand.poses
    status = by_hand.status("g2")
    assert status["refused"] == {"not_predictable": 20}
    assert "out of bounds" not in str(status)
    assert sum("fails on a frame" in record.message for record in caplog.records) == 1


def test_under_overload_a_turn_has_a_frame_of_each_glove_of_its_model() -> None:
    """A frame costs least in a full turn: with four models, and four times as much to do, it stays full."""
    for models in (1, 4):
        paces, _ = overloaded(4 * models, models)
        assert all(turn == 4 for pace in paces for turn in pace.turns[1:]), [pace.turns for pace in paces]


def test_under_overload_every_glove_gets_as_many_poses_and_the_books_balance() -> None:
    _, lanes = overloaded(12, 1)
    assert max(lane.predicted for lane in lanes) - min(lane.predicted for lane in lanes) <= 1
    assert sum(lane.skipped for lane in lanes) > 0
    for lane in lanes:
        assert lane.received == lane.predicted + lane.skipped + lane.refusals.total


def frame_of(sequence: int) -> bytes:
    return encode_frame(Frame(sequence, 1, sequence + 1, 0, np.zeros(3, np.float32)))


@given(st.lists(st.tuples(st.integers(0, 9), st.booleans(), st.integers(0, 400)), max_size=120))
def test_junk_neither_takes_nor_keeps_a_place(arrivals: list[tuple[int, bool, int]]) -> None:
    """A glove whose frame is valid is served, unless as many others sent one within the last second."""
    lanes, now, valid_at = GlovePipelines(limit=3), 10**12, dict[str, int]()
    for sequence, (glove, valid, after_ms) in enumerate(arrivals):
        now += after_ms * MILLISECOND
        key = GloveKeys("lab", f"g{glove}").raw
        message = frame_of(sequence) if valid else b"junk"
        before = {lane.keys.raw for lane in lanes.all()}
        live = {name for name, at in valid_at.items() if now - at < VALID_WITHIN_NS and name in before}
        lane = lanes.of(key, message, now)
        served = {lane.keys.raw for lane in lanes.all()}
        assert live <= served, "no glove that sends valid frames is displaced"
        assert len(served) <= 3
        if valid:
            assert (lane is not None) == (key in before or len(live) < 3)
        if lane is not None:
            lane.add(message, now)
            for waiting in lane.newest(64, 0):
                if lane.open(waiting) is not None:
                    valid_at[key] = now
    document = lanes.document()
    received = sum(lane.received for lane in lanes.all()) + document["given_up"]["messages"]
    assert received + sum(document["refused_messages"].values()) == len(arrivals)


def test_a_name_that_cannot_be_is_counted_and_told() -> None:
    lanes = GlovePipelines()
    assert lanes.of("glovecal/lab/Bad Name/raw", frame_of(0), 1) is None
    assert lanes.document()["refused_messages"] == {"unusable_name": 1, "no_room": 0}
    assert "Bad Name" in lanes.document()["sentence"]
