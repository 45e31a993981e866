"""Times of records that came together: the measured period, and nothing invented."""

from __future__ import annotations

import random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glovecal_client.capture.device_clock import ArrivalTimes


@given(
    st.floats(0.5, 1000),
    st.lists(st.tuples(st.integers(0, 400), st.integers(0, 3_000_000_000)), min_size=1, max_size=60),
)
def test_times_grow_and_are_never_later_than_the_arrival(
    nominal_hz: float, arrivals: list[tuple[int, int]]
) -> None:
    clock, now_ns, last_ns = ArrivalTimes(nominal_hz), 10**12, None
    for count, wait_ns in arrivals:
        now_ns += wait_ns + 401  # no port hands over more records than there were nanoseconds
        times = clock.of(count, now_ns)
        assert len(times) == count
        for time_ns in times:
            assert last_ns is None or time_ns > last_ns
            assert time_ns <= now_ns
            last_ns = time_ns
        if times:
            assert times[-1] == now_ns


@pytest.mark.parametrize("rate_hz", [12.0, 60.0, 192.0, 480.0])
@pytest.mark.parametrize("nominal_hz", [60.0, 100.0])
def test_records_of_an_adapter_keep_their_distance(rate_hz: float, nominal_hz: float) -> None:
    """An adapter hands over every 16 ms: steps are those of the glove, whatever rate was assumed."""
    chance = random.Random(3)
    clock, times, sent, now_s = ArrivalTimes(nominal_hz), [], 0, 1000.0
    while len(times) < 2000:
        now_s += 0.016 + 0.001 * chance.random()
        count = int((now_s - 1000) * rate_hz) - sent
        sent += count
        times += clock.of(count, int(now_s * 1e9))
    steps = np.diff(times)[200:] / 1e9
    assert np.mean(steps) == pytest.approx(1 / rate_hz, rel=0.01)
    assert np.min(steps) > 0.3 / rate_hz
    lateness = np.array(times)[200:] / 1e9 - 1000 - np.arange(201, len(times) + 1) / rate_hz
    assert np.ptp(lateness) < 0.018


def test_a_pause_is_no_slow_rate() -> None:
    clock, now_ns = ArrivalTimes(100.0), 10**12
    for _ in range(50):
        now_ns += 20_000_000
        clock.of(4, now_ns)
    now_ns += 5_000_000_000
    clock.of(1, now_ns)
    for _ in range(3):
        now_ns += 20_000_000
        times = clock.of(4, now_ns)
        assert np.diff(times) == pytest.approx(5_000_000)
