"""What is left out where takes cannot be left out whole."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.calibration.folds import (
    ALONE_SHARE,
    are_short,
    held_levels,
    pieces,
    reached_by_others,
)
from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.problem import DiagnosisProblem
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.take import Take


def test_angles_held_one_after_another_are_left_out_one_by_one():
    reference = np.repeat([0.0, 10.0, 20.0, 30.0, 40.0], 20)[:, None]
    assert held_levels(reference) == [slice(k, k + 20) for k in range(0, 100, 20)]


def test_motion_is_left_out_in_quarters():
    reference = np.linspace(0, 90, 100)[:, None]
    assert held_levels(reference) is None
    assert pieces(np.arange(100.0), reference) == [slice(k, k + 25) for k in range(0, 100, 25)]


def test_short_takes_are_those_of_a_few_seconds():
    assert are_short([np.arange(0, 6, 0.1)] * 3)
    assert not are_short([np.arange(0, 40, 0.1)] * 3)


def units(*ends: tuple[float, float]) -> list[np.ndarray]:
    """One unit for each pair of its least and most angle, degrees."""
    return [np.linspace(least, most, 101) for least, most in ends]


def test_angles_that_one_unit_alone_reaches_are_no_held_out_error():
    masks = reached_by_others(units((0.0, 50.0), (2.0, 48.0), (5.0, 80.0)))
    assert [bool(mask.all()) for mask in masks] == [True, True, False]
    kept = units((5.0, 80.0))[0][masks[2]]
    assert 50.0 <= kept.max() <= 50.0 + ALONE_SHARE * 80.0


@pytest.mark.parametrize(
    "ends",
    [
        [(0.0, 50.0), (2.0, 54.0), (1.0, 49.0)],
        [(0.0, 50.0), (0.0, 90.0)],
        [(0.0, 9.0), (0.0, 9.0), (40.0, 90.0)],
    ],
    ids=["a little beyond", "two units", "a unit of its own"],
)
def test_nothing_is_left_out_without_need(ends):
    assert all(mask.all() for mask in reached_by_others(units(*ends)))


def test_units_without_rows_are_none_that_others_could_miss():
    masks = reached_by_others([*units((0.0, 50.0), (0.0, 50.0), (0.0, 90.0)), np.empty(0)])
    assert not masks[2].all()
    assert len(masks[3]) == 0


def test_a_clean_joint_has_its_usual_error_where_one_take_goes_far_beyond_the_others():
    """Seed 11: T_VIR goes 9 degrees beyond the eight other takes; the base was 5 degrees wrong there."""
    sensors = ("T_TMC", "TI_ABD", "T_VIR", "T_IP")
    takes = record_session(SessionPlan(seed=11, sensors=sensors, takes_per_wearing=3, take_s=20.0)).takes
    found = diagnose(takes, Layout.from_columns("thumb", sensors, sensors))
    assert found.rmse_deg["T_VIR"] < 0.8


@pytest.fixture(scope="module")
def creeping() -> list[Take]:
    """A weak creep in three takes of free motion, and a fourth of slow ramps."""
    sensors = ("I_MCP", "I_PIP")
    plan = SessionPlan(
        seed=4, sensors=sensors, wearings=1, takes_per_wearing=4, take_s=25.0,
        motions=("natural", "natural", "natural", "ramps"),
    )  # fmt: skip
    return list(record_session(plan, [Cause("creep", "two_exponentials", strength_deg=2.0)]).takes)


def unit_takes(takes: Sequence[Take], names: Sequence[str]) -> tuple[int, ...]:
    layout = Layout.from_columns("two", ("I_MCP", "I_PIP"), ("I_MCP", "I_PIP"))
    renamed = [replace(take, name=name) for take, name in zip(takes, names, strict=True)]
    return DiagnosisProblem.of(renamed, layout, False, ()).design().unit_take


def test_the_only_take_of_its_motion_is_left_out_in_quarters(creeping):
    assert unit_takes(creeping, ["w1-t1", "w1-t2", "w1-t3", "w1-ramps-1"]) == (0, 1, 2, 3, 3, 3, 3)


@pytest.mark.parametrize(
    "names",
    [
        ["w1-t1", "w1-t2", "w1-t3", "w1-t4"],
        ["fist", "flat", "ok", "spread"],
        ["a-1", "a-2", "ramps-1", "ramps-2"],
    ],
    ids=["one motion", "each its own", "two of each"],
)
def test_other_takes_are_left_out_whole(creeping, names):
    assert unit_takes(creeping, names) == (0, 1, 2, 3)
