"""A reference clock whose offset changes within a take is followed; one that does not is left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.effects.delay.clock_offset import ClockOffsetEffect
from glovecal_models.effects.delay.clock_wander import ClockWander, clock_wander, without_wander
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.take import Take

SHIFTS = {
    "pulled in": lambda time: 0.08 * np.exp(-time / 6.0),
    "set right": lambda time: np.where(time < 13.0, -0.02, 0.06),
    "wandering": lambda time: 0.05 * np.sin(2 * np.pi * time / 17.0),
}


@pytest.fixture(scope="module")
def takes() -> tuple[Take, ...]:
    return record_session(SessionPlan(seed=4, wearings=1, takes_per_wearing=3, take_s=25.0)).takes


def moved(take: Take, shift) -> Take:
    """The reference stamped later by ``shift`` of the frame time."""
    return replace(take, reference_time_s=take.reference_time_s + shift(take.reference_time_s))


@pytest.mark.parametrize("name", SHIFTS)
def test_an_offset_that_changes_is_followed(takes, name):
    shift, random = SHIFTS[name], np.random.default_rng(1)
    for take in takes:
        predicted = take.reference_at_frames(take.rotations) + random.normal(0.0, 1.0, take.readings.shape)
        found = clock_wander(moved(take, shift), take.rotations, predicted)
        assert found is not None
        inside = (found.at_s > 1.0) & (found.at_s < 24.0)
        inside &= np.abs(found.at_s - 13.0) > 1.5
        error = found.offset_s[inside] - shift(found.at_s[inside])
        assert np.sqrt(np.mean(error**2)) < 0.01


def test_a_constant_clock_is_not_followed(takes):
    random = np.random.default_rng(2)
    for take in takes:
        predicted = take.reference_at_frames(take.rotations) + random.normal(0.0, 1.0, take.readings.shape)
        assert clock_wander(take, take.rotations, predicted) is None


def test_removing_is_the_inverse_of_moving(takes):
    shift = SHIFTS["wandering"]
    at = np.arange(0.0, 26.0, 0.05)
    back = ClockWander(at, shift(at)).removed(moved(takes[0], shift))
    assert np.allclose(back.reference_time_s, takes[0].reference_time_s, atol=1e-3)


def test_takes_are_repaired_by_what_their_readings_say(takes):
    shift = SHIFTS["pulled in"]
    clock = ClockOffsetEffect()
    zero = {take.name: 0.0 for take in takes}
    settings = {"offset_s": zero, "common_s": 0.0, "per_take": True}
    wrong = [moved(take, shift) for take in takes]
    for follows, most_s in ((False, np.inf), (True, 0.015)):
        repaired = clock.repaired(wrong, settings | {"within_takes": follows})
        for take, mended in zip(takes, repaired, strict=True):
            left = np.abs(mended.reference_time_s - take.reference_time_s)
            assert np.sqrt(np.mean(left**2)) < most_s
            assert follows or np.allclose(left, shift(take.reference_time_s))


def test_takes_whose_sensors_stand_in_another_order_are_repaired_alike(takes):
    wrong = [moved(take, SHIFTS["pulled in"]) for take in takes]
    order = wrong[0].sensors[::-1]
    turned = replace(wrong[0], sensors=order, readings=wrong[0].readings[:, ::-1])
    fewer = replace(wrong[1], sensors=wrong[1].sensors[:1], readings=wrong[1].readings[:, :1])
    for plain, other in zip(without_wander(wrong), without_wander([turned, *wrong[1:]]), strict=True):
        assert np.allclose(plain.reference_time_s, other.reference_time_s, atol=1e-9)
    assert len(without_wander([wrong[0], fewer])) == 2
    assert without_wander([]) == ()
