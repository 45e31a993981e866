"""A ramp of poses is confounded with its order; a random order, free motion and its repetitions are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.calibration.order_confounding import order_confounding
from glovecal_models.calibration.text import order_sentences
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.take import Take

LEVELS = (0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0)


def posed(levels: tuple[float, ...], name: str = "poses", begins_s: float = 0.0) -> Take:
    """Each level held for two seconds; a second rotation does the same in the opposite order."""
    time_s = begins_s + np.arange(len(levels) * 100) / 50.0
    angles = np.repeat(levels, 100)
    random = np.random.default_rng(3)
    reference = np.column_stack([angles, angles[::-1]]) + random.normal(0, 1.0, (len(angles), 2))
    return Take(name, "monday", ("A", "B"), time_s, reference + 100, ("A", "B"), time_s, reference)


def shuffled(seed: int) -> tuple[float, ...]:
    return tuple(np.random.default_rng(seed).permutation(LEVELS).tolist())


def test_a_ramp_fires_for_each_rotation_and_says_what_to_do() -> None:
    found = order_confounding([posed(LEVELS)])
    assert {item.rotation for item in found if item.is_confounded} == {"A", "B"}
    assert all(item.r2 > 0.9 and item.inflation > 10 and item.p_value <= 0.01 for item in found)
    assert all(item.shifted_r2 < 0.6 for item in found)
    (said,) = order_sentences(found)
    assert said.startswith("In monday posture goes with time:")
    assert "R2 of time by angle is " in said
    assert "Add a take with these rotations in random order" in said


def test_a_staircase_of_three_or_of_two_fires() -> None:
    for levels in ((0.0, 30.0, 60.0), (0.0, 90.0)):
        assert all(item.is_confounded for item in order_confounding([posed(levels)])), levels


def test_ramps_that_come_back_or_repeat_do_not_fire() -> None:
    for levels in ((*LEVELS, *LEVELS[::-1]), (*LEVELS, *LEVELS), (*LEVELS, *LEVELS, *LEVELS)):
        assert not any(item.is_confounded for item in order_confounding([posed(levels)])), levels


def test_a_random_order_seldom_fires() -> None:
    """Seven levels, unrestricted: one order in fifty goes with time by itself."""
    fired = sum(order_confounding([posed(shuffled(seed))])[0].is_confounded for seed in range(40))
    assert fired <= 3


@pytest.mark.parametrize("seed", [1, 2])
def test_free_motion_of_a_clean_session_does_not_fire(seed: int) -> None:
    takes = record_session(SessionPlan(seed=seed, sensors=("I_MCP", "I_PIP")), []).takes
    found = order_confounding(takes)
    assert found
    assert not any(item.is_confounded for item in found)
    assert not order_sentences(found)


def test_takes_on_one_clock_are_one_stretch_and_others_are_not() -> None:
    after = [posed((level,), f"t{number}", 10.0 * number) for number, level in enumerate(LEVELS)]
    assert all(item.is_confounded for item in order_confounding(after))
    each_from_zero = [
        replace(take, time_s=t, reference_time_s=t) for take in after for t in [np.arange(100.0)]
    ]
    assert not any(item.is_confounded for item in order_confounding(each_from_zero))


def test_what_is_hardly_measured_or_never_moves_says_nothing() -> None:
    still = posed((20.0, 20.0, 20.0))
    assert not any(item.is_confounded for item in order_confounding([still]))
    flat = replace(still, reference=np.full_like(still.reference, 20.0))
    assert not any(item.is_confounded for item in order_confounding([flat]))
    assert order_confounding([replace(still, reference=np.full_like(still.reference, np.nan))]) == ()
