"""The box's time stamps as times of the computer: jitter removed, wraps and restarts survived."""

import random
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from glovecal_client.capture.device_clock import DeviceClock

TICKS_PER_SECOND = 115200


def walk(
    first_tick: int, delays_s: list[float], drift: float = 0.0
) -> tuple[list[int], list[int], list[int]]:
    """Times taken, arrivals and times given, in ns, of records 10 ms apart."""
    clock, taken, arrived, given_back = DeviceClock(TICKS_PER_SECOND), [], [], []
    for number, delay_s in enumerate(delays_s):
        time_s = 1000.0 + 0.01 * number
        ticks = int(first_tick + 0.01 * number * (1 + drift) * TICKS_PER_SECOND) % 2**32
        taken.append(int(time_s * 1e9))
        arrived.append(int((time_s + delay_s) * 1e9))
        given_back.append(clock.monotonic_ns(ticks, arrived[-1]))
    return taken, arrived, given_back


@given(st.integers(0, 2**32 - 1), st.lists(st.floats(0.001, 0.5), min_size=2, max_size=60))
def test_times_grow_and_are_never_later_than_the_arrival(first_tick: int, delays_s: list[float]) -> None:
    arrivals_in_order = []
    for number, delay_s in enumerate(delays_s):
        earliest = arrivals_in_order[-1] if arrivals_in_order else 0.0
        arrivals_in_order.append(max(earliest, 0.01 * number + delay_s))
    delays_s = [arrival - 0.01 * number for number, arrival in enumerate(arrivals_in_order)]
    _, arrived, given_back = walk(first_tick, delays_s)
    assert all(late > early for early, late in pairwise(given_back))
    assert all(time <= arrival + len(delays_s) for time, arrival in zip(given_back, arrived, strict=True))


def test_the_jitter_of_a_serial_adapter_is_taken_out() -> None:
    """Arrivals scatter over 16 ms; after half a minute times are right to 1 ms, quartzes 100 ppm apart."""
    chance = random.Random(1)
    for drift in (-1e-4, 0.0, 1e-4):
        delays_s = [0.002 + 0.016 * chance.random() ** 2 for _ in range(6000)]
        taken, _, given_back = walk(17, delays_s, drift)
        errors = [time - 2_000_000 - true for time, true in zip(given_back, taken, strict=True)][3000:]
        assert max(abs(error) for error in errors) < 1_000_000


def test_the_wrap_after_ten_hours_goes_unnoticed() -> None:
    taken, _, given_back = walk(2**32 - 500, [0.003] * 100)
    assert all(abs(time - 3_000_000 - true) < 20_000 for time, true in zip(given_back, taken, strict=True))


def test_a_restarted_box_is_followed() -> None:
    clock = DeviceClock(TICKS_PER_SECOND)
    clock.monotonic_ns(5_000_000, 10_000_000_000)
    clock.monotonic_ns(5_001_152, 10_010_000_000)
    assert clock.monotonic_ns(3, 12_000_000_000) == 12_000_000_000
    assert abs(clock.monotonic_ns(3 + 1152, 12_010_000_000) - 12_010_000_000) < 10_000
