"""A take that does not belong is named before any effect is, with what would make it fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.comparison.odd_takes import fitting, odd_takes
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.take import Take

FINGERS = ("I_PIP", "M_PIP", "R_PIP", "P_PIP")
OWN = Layout.from_columns("own", FINGERS, FINGERS)
ALL = Layout.from_columns("all", ("A", "B", "C", "D"), FINGERS)


def bent(seed: int, layout: Layout, glove: int = 0, wearing: str = "w") -> Take:
    """20 s at 30 Hz: four flex sensors of one glove with a mild curve; fingers that move half together."""
    random, made = np.random.default_rng([glove, seed]), np.random.default_rng(glove)
    gain, zero = made.uniform(10, 25, 4), made.uniform(500, 1500, 4)
    time = np.arange(600) / 30
    phases = random.uniform(0, 6, (5, 3))
    waves = (np.sin(time[:, None, None] * random.uniform(0.5, 4, 3) + phases)).sum(axis=2)
    angles = 45 + 12 * waves[:, :4] + 8 * waves[:, 4:]
    readings = zero + gain * angles * (1 + 0.001 * angles) + 12 * random.normal(size=angles.shape)
    noisy = angles + 0.4 * random.normal(size=angles.shape)
    return Take(f"t{seed}", wearing, layout.sensors, time, np.round(readings), FINGERS, time, noisy)


def with_sensors(*order: int) -> Callable[[Take], Take]:
    return lambda take: replace(take, readings=take.readings[:, order])


def with_reference(change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Take], Take]:
    return lambda take: replace(take, reference=change(take.reference))


SENSORS = {"sensors", "columns"}
CHANGES: dict[str, tuple[Callable[[Take], Take], set[str], str]] = {
    "sensors in reverse order": (with_sensors(3, 2, 1, 0), SENSORS, "reverse order"),
    "two plugs exchanged": (with_sensors(0, 2, 1, 3), SENSORS, "exchanged"),
    "one plug off": (with_sensors(1, 2, 3, 0), SENSORS, "another order"),
    "reference reversed": (with_reference(lambda x: x[:, ::-1]), SENSORS | {"rotations"}, "reverse order"),
    "the other sign": (with_reference(lambda x: -x), {"signs"}, "all rotations"),
    "the other sign of one": (with_reference(lambda x: x * [1, 1, -1, 1]), {"signs"}, "R_PIP"),
    "late": (lambda take: replace(take, reference_time_s=take.time_s + 0.9), {"shift"}, "0.90 s later"),
}


def test_takes_whose_clocks_are_all_off_stay_for_who_repairs_clocks():
    takes = [bent(number, ALL) for number in range(5)]
    late = [
        replace(take, reference_time_s=take.time_s + by)
        for take, by in zip(takes, (0.4, 0.6, 0.8, 1.0, 2.4), strict=True)
    ]
    assert fitting(late, odd_takes(late, ALL)) == late


@pytest.mark.parametrize("layout", [OWN, ALL], ids=["own sensor", "all sensors"])
@pytest.mark.parametrize("change", CHANGES)
def test_what_would_make_it_fit_is_named(change, layout):
    takes = [bent(number, layout) for number in range(5)]
    changed, how, words = CHANGES[change]
    takes[3] = changed(takes[3])
    [found] = odd_takes(takes, layout)
    assert (found.place, found.take) == (3, "t3")
    assert found.how in how
    assert words in found.sentence
    assert found.fitted_deg < 2.0 < found.error_deg
    kept = ["t0", "t1", "t2", "t4"] if found.how != "shift" else ["t0", "t1", "t2", "t3", "t4"]
    assert [take.name for take in fitting(takes, [found])] == kept, "a clock is repaired"


@pytest.mark.parametrize("glove", [3, 5, 8])
def test_another_glove_or_person(glove):
    takes = [*(bent(number, OWN) for number in range(4)), bent(4, OWN, glove)]
    [found] = odd_takes(takes, OWN)
    assert found.place == 4
    assert found.how in ("gains", "own map", "level")
    assert "nother" in found.sentence


def test_two_takes_that_do_not_belong():
    takes = [bent(number, OWN) for number in range(7)]
    for number in (2, 5):
        takes[number] = replace(takes[number], readings=takes[number].readings[:, ::-1])
    assert {found.place for found in odd_takes(takes, OWN)} == {2, 5}


def test_of_two_takes_nobody_knows_which_is_odd():
    takes = [bent(0, OWN), replace(bent(1, OWN), readings=bent(1, OWN).readings[:, ::-1])]
    assert odd_takes(takes, OWN) == ()


@pytest.mark.parametrize("layout", [OWN, ALL], ids=["own sensor", "all sensors"])
def test_takes_that_belong_together(layout):
    assert odd_takes([bent(number, layout, 2) for number in range(5)], layout) == ()


@pytest.mark.parametrize(
    "cause",
    ["cross_coupling", "hysteresis", "donning_shift", "supply_sag", "clock_offset", "sensor_fault", "lag"],
)
def test_an_effect_makes_no_take_odd(cause):
    plan = SessionPlan(
        seed=77, wearings=2, takes_per_wearing=2, take_s=8.0, motions=("natural", "one_finger")
    )
    takes = record_session(plan, [Cause(cause, strength_deg=6.0)]).takes
    assert odd_takes(takes, Layout.from_columns("x", plan.sensors, plan.rotations)) == ()
