"""More messages than a glove can send are counted and not looked into; they cost its own run nothing."""

from __future__ import annotations

import dataclasses

from hypothesis import given, settings
from hypothesis import strategies as st
from loop_by_hand import moving_frames

from glovecal_client.keys import GloveKeys
from glovecal_client.wire.frame import encode_frame
from glovecal_service.incoming.rate_limit import BURST, FEWEST_HZ, MOST_HZ, RateLimit
from glovecal_service.realtime.glove_lanes import WAITING_LIMIT, GlovePipeline


@settings(max_examples=100)
@given(
    rate_hz=st.one_of(st.none(), st.floats(0.001, 1e6)),
    steps_ns=st.lists(st.integers(-1_000_000, 3_000_000), min_size=1, max_size=60),
    together=st.integers(1, 200),
)
def test_never_more_than_the_rate_and_one_burst(
    rate_hz: float | None, steps_ns: list[int], together: int
) -> None:
    limit = RateLimit()
    limit.declare(rate_hz)
    most_hz = MOST_HZ if rate_hz is None else min(max(4 * rate_hz, FEWEST_HZ), MOST_HZ)
    at_ns = latest_ns = 10**15
    passed = 0
    for step_ns in steps_ns:
        at_ns += step_ns
        latest_ns = max(at_ns, latest_ns)
        passed += sum(limit.allows(at_ns) for _ in range(together))
    assert passed <= BURST + most_hz * (latest_ns - 10**15 + 1_000_000) / 1e9 + 1
    assert passed >= min(BURST, len(steps_ns) * together)


def test_a_flood_in_a_gloves_name_does_not_cost_it_a_frame() -> None:
    lane = GlovePipeline(GloveKeys("lab", "g1"))
    lane.declare_rate(100.0)
    frames = moving_frames(300)
    strange = encode_frame(dataclasses.replace(frames[0], run_id=99))
    passed = added = 0
    for number, frame in enumerate(frames):
        at_ns = 10**15 + number * 10_000_000
        for message in [b"junk", strange] * (50 if number else 0):  # 10,000 a second
            added += lane.add(message, at_ns)
        added += lane.add(encode_frame(frame), at_ns)
        for waiting in lane.newest(WAITING_LIMIT, 0):
            passed += lane.open(waiting) is not None
    assert passed == 300
    assert added <= 300 + BURST + FEWEST_HZ * 3.0 + 1
    counts = lane.status(lambda *_: 0)
    assert counts["received"] == 300 + 299 * 100
    assert counts["missing"] == 0
    assert counts["refused"]["too_many"] == counts["received"] - added
    assert counts["received"] == 300 + counts["skipped"] + sum(counts["refused"].values())


def test_a_glove_that_repeats_itself_ten_times_over_is_bounded_too() -> None:
    lane = GlovePipeline(GloveKeys("lab", "g1"))
    frames = moving_frames(300)
    added: list[bool] = []
    for number, frame in enumerate(frames):
        at_ns = 10**15 + number * 10_000_000
        added = [lane.add(encode_frame(frame), at_ns) for _ in range(100)]
        for waiting in lane.newest(WAITING_LIMIT, 0):
            lane.open(waiting)
    assert sum(added) <= MOST_HZ / 100 + 1
    counts = lane.status(lambda *_: 0)
    assert counts["received"] == 30_000 == counts["skipped"] + sum(counts["refused"].values()) + 300
