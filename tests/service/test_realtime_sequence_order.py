"""Numbers that no glove can have reached are refused; a publisher that means them is soon heard again."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from glovecal_client.plausible_loss import BURST_FRAMES, MOST_FRAMES_PER_S, PlausibleLoss
from glovecal_client.wire.frame import Frame, encode_frame
from glovecal_service.incoming.frame_gate import TAKEOVER_AFTER_NS, FrameGate, Refusal, RefusalCount, Refused

SECOND = 1_000_000_000
LARGEST = 2**64 - 1


class Stream:
    """What a gate does with frames given to it at times of one clock."""

    def __init__(self) -> None:
        self.gate = FrameGate()
        self.refusals = RefusalCount("g1")
        self.given = 0
        self.passed: list[tuple[int, int, int]] = []
        """(jumps and runs so far, sequence number, time)"""

    @property
    def missing(self) -> int:
        return self.gate.standing.missing if self.gate.standing else 0

    def give(self, sequence: int, at_ns: int, *, run_id: int = 1, sent_ns: int | None = None) -> bool:
        """``sent_ns``: by the frame's own clock, where that is not when it came."""
        self.given += 1
        own_ns = at_ns if sent_ns is None else sent_ns
        frame = Frame(sequence, run_id, own_ns + self.given, own_ns, np.zeros(2, np.float32))
        try:
            self.gate.pass_frame(encode_frame(frame), at_ns)
        except Refused as refused:
            self.refusals.add(refused)
            return False
        self.passed.append((self.gate.jumps + self.gate.runs, sequence, at_ns))
        return True

    def run(self, sequences: Iterable[int], *, from_s: float, rate_hz: float = 120.0, run_id: int = 1) -> int:
        """Frames at an even rate; how many passed."""
        times = (round((from_s + at / rate_hz) * SECOND) for at in range(1_000_000))
        return sum(
            self.give(sequence, at, run_id=run_id) for sequence, at in zip(sequences, times, strict=False)
        )


def test_a_loss_is_bounded_by_the_time_that_passed() -> None:
    loss = PlausibleLoss(0)
    assert not loss.allows(BURST_FRAMES + 1, 0)
    assert loss.allows(BURST_FRAMES, 0)
    assert not loss.allows(1, 0), "what was spent is gone"
    assert not loss.allows(60 * MOST_FRAMES_PER_S + 1, 60 * SECOND)
    assert loss.allows(60 * MOST_FRAMES_PER_S, 60 * SECOND)
    assert loss.allows(0, 30 * SECOND), "a clock that steps back costs nothing"


@pytest.mark.parametrize("wild", [999_999_999, LARGEST, 5000])
def test_one_wild_number_costs_one_frame(wild: int) -> None:
    stream = Stream()
    stream.run(range(100), from_s=0.0)
    assert not stream.give(wild, SECOND)
    assert stream.run(range(100, 200), from_s=1.0) == 100
    assert stream.refusals.by_reason() == {"sequence_jump": 1}
    assert (stream.gate.sequence, stream.missing, stream.gate.jumps) == (199, 0, 0)


def test_an_outage_is_a_loss_and_no_jump() -> None:
    stream = Stream()
    stream.run(range(100), from_s=0.0)
    assert stream.run(range(100 + 7200, 100 + 7300), from_s=60.0) == 100
    assert (stream.missing, stream.gate.jumps) == (7200, 0)


@pytest.mark.parametrize("stood_s", [5, 20, 60, 3600])
def test_frames_that_waited_while_this_process_stood_still_are_no_jump(stood_s: int) -> None:
    """What a buffer kept of them arrives at once, and right after it the glove is far ahead."""
    stream, rate_hz = Stream(), 120
    stream.run(range(100), from_s=0.0)
    woke_ns = (1 + stood_s) * SECOND
    for sequence in range(100, 200):
        assert stream.give(sequence, woke_ns, sent_ns=sequence * SECOND // rate_hz)
    for sequence in range(100 + stood_s * rate_hz, 200 + stood_s * rate_hz):
        assert stream.give(sequence, woke_ns + sequence, sent_ns=sequence * SECOND // rate_hz)
    assert (stream.missing, stream.gate.jumps) == (stood_s * rate_hz - 100, 0)


def test_a_run_that_began_while_this_process_stood_still_is_missing_from_its_first_frame() -> None:
    stream = Stream()
    stream.run(range(100), from_s=0.0)
    assert stream.give(100, 21 * SECOND, sent_ns=SECOND)
    woke_ns = 21 * SECOND + 2 * TAKEOVER_AFTER_NS
    assert stream.give(2400, woke_ns, sent_ns=21 * SECOND, run_id=2)
    assert stream.missing == 2400


@pytest.mark.parametrize("begins_at", [10**9, LARGEST - 500, 0, 40])
@pytest.mark.parametrize("rate_hz", [9.0, 120.0])
def test_a_publisher_that_really_jumped_is_heard_within_a_second(begins_at: int, rate_hz: float) -> None:
    stream = Stream()
    stream.run(range(100), from_s=0.0, rate_hz=rate_hz)
    from_s = 100 / rate_hz
    passed = stream.run(range(begins_at, begins_at + 300), from_s=from_s, rate_hz=rate_hz)
    assert passed >= 300 - rate_hz
    heard_at = next(at for jumps, _, at in stream.passed if jumps == 2)
    assert heard_at - from_s * SECOND < SECOND
    assert (stream.missing, stream.gate.jumps) == (0, 1), "the numbers jumped over were never sent"
    assert stream.given == len(stream.passed) + stream.refusals.total


def test_a_number_a_little_too_far_is_taken_back() -> None:
    """It fits as a loss; when the glove's own frames go on below it, nothing was lost."""
    stream = Stream()
    stream.run(range(100), from_s=0.0)
    assert stream.give(1000, SECOND)
    assert stream.missing == 900
    assert stream.run(range(100, 300), from_s=1.0) >= 100
    assert (stream.missing, stream.gate.jumps) == (0, 1)


def test_numbers_after_the_largest_begin_again() -> None:
    stream = Stream()
    stream.run(range(LARGEST - 99, LARGEST + 1), from_s=0.0)
    assert stream.run(range(200), from_s=1.0) >= 100


def test_an_echo_never_takes_over_while_the_glove_is_there() -> None:
    """The same frames again, half a second late, from somebody who forwards them."""
    stream = Stream()
    for sequence in range(600):
        at = round(sequence / 120 * SECOND)
        assert stream.give(sequence, at)
        if sequence >= 60:
            assert not stream.give(sequence - 60, at + 1)
    assert stream.refusals.by_reason() == {"sequence_backwards": 540}
    assert (stream.missing, stream.gate.jumps) == (0, 0)


def test_of_two_publishers_on_one_key_one_is_heard_and_the_other_counted() -> None:
    stream = Stream()
    for at in range(600):
        stream.give(at, round(at / 120 * SECOND))
        stream.give(10**9 + at, round(at / 120 * SECOND) + 1)
        stream.give(at, round(at / 120 * SECOND) + 2, run_id=2)
    assert [sequence for _, sequence, _ in stream.passed] == list(range(600))
    assert stream.refusals.by_reason() == {"sequence_jump": 600, "second_publisher": 600}


def test_a_run_that_had_to_wait_for_another_lost_nothing() -> None:
    stream = Stream()
    stream.run(range(100), from_s=0.0, run_id=1)
    last_s = 99 / 120
    stream.run(range(120), from_s=last_s + 0.01, run_id=2)
    assert stream.refusals.by_reason() == {"second_publisher": round(120 * TAKEOVER_AFTER_NS / SECOND) - 1}
    assert (stream.missing, stream.gate.sequence, stream.gate.runs) == (0, 119, 2)


def test_the_first_frames_of_a_new_run_are_missing_when_they_never_came() -> None:
    stream = Stream()
    stream.run(range(50, 100), from_s=0.0)
    stream.run(range(30, 60), from_s=5.0, run_id=2)
    assert stream.missing == 30, "of the first run nobody knows when the service was not there yet"
    stream.run(range(10**12, 10**12 + 10), from_s=10.0, run_id=3)
    assert stream.missing == 30


def test_messages_that_could_not_be_read_are_not_missing_too() -> None:
    stream = Stream()
    stream.run(range(10), from_s=0.0)
    for _ in range(2):
        with pytest.raises(Refused, match="cut short"):
            stream.gate.pass_frame(b"GLVF", SECOND)
    stream.gate.note_unread(3)
    stream.give(20, SECOND)
    assert stream.missing == 10 - 5
    stream.give(30, SECOND)
    assert stream.missing == 5 + 9


wild_numbers = st.one_of(
    st.integers(0, LARGEST), st.integers(0, 1500), st.sampled_from([0, LARGEST, LARGEST - 1, 2**63])
)
wild_frames = st.lists(
    st.tuples(st.integers(1, 4000), wild_numbers, st.booleans(), st.integers(1, 3)), max_size=30
)


@settings(max_examples=60)
@example([(1, 31, False, 1), (502, 0, False, 2)], 60, None, 0)
@given(wild_frames, st.integers(60, 200), st.none() | st.integers(0, LARGEST - 1000), st.integers(0, 100))
def test_whatever_comes_between_a_steady_publisher_is_heard_every_second(
    wild: list[tuple[int, int, bool, int]], rate_hz: int, jumps_to: int | None, begins_at: int
) -> None:
    """Four seconds of a glove, which may jump after two; ten wild frames a second at most."""
    own, arrivals = set(), []
    for at in range(4 * rate_hz):
        number = begins_at + at if jumps_to is None or at < 2 * rate_hz else jumps_to + at - 2 * rate_hz
        arrivals.append((at * SECOND // rate_hz, True, number, 1))
    spaced = {at_ms // 100: (at_ms, near, number, run) for at_ms, number, near, run in wild}
    for at_ms, near, number, run in spaced.values():
        near_number = min(LARGEST, begins_at + at_ms * rate_hz // 1000 + number % 1500)
        arrivals.append((at_ms * 1_000_000, False, near_number if near else number, run))
    stream = Stream()
    for at, is_own, number, run in sorted(arrivals):
        if stream.give(number, at, run_id=run) and is_own:
            own.add(at)
    assert stream.given == len(stream.passed) + stream.refusals.total
    for (epoch, number, _), (next_epoch, next_number, _) in zip(
        stream.passed, stream.passed[1:], strict=False
    ):
        assert next_epoch > epoch or (next_epoch == epoch and next_number > number)
    heard = [0, *sorted(own), 4 * SECOND]
    assert max(after - before for before, after in itertools.pairwise(heard)) < SECOND
    assert 0 <= stream.missing < 4 * MOST_FRAMES_PER_S + BURST_FRAMES + 10_000
    assert Refusal.DAMAGED.value not in stream.refusals.by_reason()
