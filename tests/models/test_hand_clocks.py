"""Two hands on one clock: claps found below a frame, time codes, one computer, and what cannot be told."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_models.errors import BadInput
from glovecal_models.simulation.protocol import free_segment
from glovecal_models.simulation.simulated_glove import Performance, SimulatedGlove
from glovecal_models.takes.hand_clocks import TakeClock, align, common_events
from glovecal_models.takes.take import Take

CLAPS_S = (4.0, 5.1, 6.7)


def hand(
    seed: int, *, rate_hz: float = 90.0, begin_s: float = 0.0, claps: tuple[float, ...] = CLAPS_S
) -> Take:
    """Twelve seconds of free motion of one hand, its clock ``begin_s`` ahead; a clap bends all for 50 ms."""
    glove = SimulatedGlove(seed, "cyberglove18")
    phase = np.random.default_rng(seed).uniform(0, 1 / rate_hz)
    time_s = np.arange(0.0, 12.0, 1 / rate_hz) + phase
    motion = Performance(glove.hand, iter([free_segment(seed, 14.0, 0)]), glove.rotations)
    degrees = motion.at(time_s)[0]
    for clap_s in claps:
        degrees += 12.0 * np.exp(-0.5 * ((time_s - clap_s) / 0.02) ** 2)[:, None]
    return Take(f"hand-{seed}", "w", glove.sensors, time_s + begin_s, glove.readings(degrees), simulated=True)


@pytest.mark.parametrize("seed", range(6))
def test_claps_tell_the_shift_below_half_a_frame(seed: int) -> None:
    found = common_events(hand(seed), hand(seed + 20, begin_s=0.731))
    assert found.count >= 2
    assert abs(found.shift_s + 0.731) <= 0.005
    assert abs(found.shift_s + 0.731) <= 5 * found.sd_s + 0.001


def test_a_hand_that_did_not_clap_is_told_so() -> None:
    with pytest.raises(BadInput, match="clap"):
        common_events(hand(1), hand(2, claps=()), 0.02)


def test_even_claps_fit_in_more_than_one_way() -> None:
    with pytest.raises(BadInput, match="more than one way"):
        common_events(hand(3, claps=(3.0, 4.0)), hand(4, claps=(3.5,)))


def own(kind: str, own_s: float, drift_ppm: float) -> dict[str, object]:
    return {"kind": kind, "own_s": own_s, "at_monotonic_s": 100.0, "drift_ppm": drift_ppm, "sd_s": 0.0004}


def test_one_computer_needs_no_shift_and_a_time_code_gives_one() -> None:
    right, left = hand(1), hand(2)
    one = TakeClock.of_accounting(
        {"computer": "a", "wall_minus_time_s": 5.0, "own_clock": own("ltc", 86399.0, 20.0)}
    )
    same = TakeClock.of_accounting({"computer": "a"})
    assert align(right, left, (one, same)).shift_s == 0
    other = TakeClock.of_accounting(
        {"computer": "b", "wall_minus_time_s": 9.0, "own_clock": own("ltc", 4.0, -30.0)}
    )
    found = align(right, left, (one, other))
    assert found.how == "timecode"
    for time_s in (0.0, 6.0, 3600.0):
        first_s = found.onto_first(np.array([time_s]))[0]
        assert (one.own_s(first_s) - other.own_s(time_s)) % 86400 == pytest.approx(0, abs=1e-6) or (
            one.own_s(first_s) - other.own_s(time_s)
        ) % 86400 == pytest.approx(86400, abs=1e-6)
    assert found.drift == pytest.approx(-50e-6, abs=1e-8)


def test_two_computers_without_a_time_code_go_by_the_wall_clock_and_tables_by_nothing() -> None:
    right, left = hand(1), hand(2)
    one, other = TakeClock("a", 5.0), TakeClock("b", 9.5)
    found = align(right, left, (one, other))
    assert (found.how, found.shift_s) == ("wall clocks", 4.5)
    assert align(right, left, (TakeClock(), TakeClock())).how == "assumed"
