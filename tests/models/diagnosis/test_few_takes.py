"""Few takes need more certainty: blocks of one take go together, and one take may be unlike all others. So
does what one joint of many shows: each is a chance to err."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.text import diagnosis_sentences
from glovecal_models.effects.base.assessment import Assessment, JointErrors, signed_rank
from glovecal_models.effects.base.facts import BETWEEN_TAKES
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import FIVE_SENSORS, SessionPlan

LAYOUT = Layout.from_columns("five", FIVE_SENSORS, FIVE_SENSORS)

BLOCKS_OF_A_TAKE = 4


def assessed(takes: int, saved: np.ndarray, p_value: float | None = None) -> Assessment:
    """An effect that saves shares (takes, 4) of the squared error of each block, and a control nothing."""
    base = np.full(saved.size, 100.0)
    take = np.repeat(np.arange(takes), BLOCKS_OF_A_TAKE)
    errors = JointErrors(base, base * (1.0 - saved.ravel()), base, saved.size, take)
    return Assessment("creep", ("I_PIP",), (errors,), (), (), p_value)


def mostly(share: float, takes: int) -> np.ndarray:
    """(takes, 4): every fourth block gets worse."""
    return np.tile(share * np.array([1.5, 1.5, 1.5, -0.5]), (takes, 1))


@pytest.mark.parametrize(("takes", "is_named"), [(6, False), (12, True)])
def test_the_same_share_is_named_with_many_takes_alone(takes, is_named):
    assert bool(assessed(takes, mostly(0.15, takes)).significant_joints) is is_named


def test_a_large_share_needs_no_more_certainty_unless_one_take_has_it_all():
    everywhere = mostly(0.6, 6)
    alone = np.full((6, BLOCKS_OF_A_TAKE), 0.02)
    alone[2] = 0.9
    alone[:, 3] = -0.01
    assert assessed(6, everywhere).significant_joints
    assert not assessed(6, alone).significant_joints


def test_a_large_share_of_a_few_blocks_needs_more_certainty():
    saved = np.tile([0.04, 0.04, 0.04, -0.02], (6, 1))
    saved[:3, 0] = 0.95
    steady = assessed(6, saved)
    base = np.where(saved.ravel() > 0.9, 2000.0, 100.0)
    errors = replace(steady.errors[0], base=base, added=base * (1.0 - saved.ravel()), control=base)
    assert errors.contrast_of_several > 0.5
    assert signed_rank(errors.beyond_control) < 0.002
    assert not replace(steady, errors=(errors,)).significant_joints


def test_a_column_that_goes_along_with_few_takes_is_chance_more_often():
    everywhere = mostly(0.6, 12)
    between = (BETWEEN_TAKES.of_few_takes, BETWEEN_TAKES.clear)
    for p_value, takes, is_named in ((between[0], 6, True), (between[1], 6, False), (between[1], 12, True)):
        assert bool(assessed(takes, everywhere[:takes], p_value).significant_joints) is is_named
    assert not assessed(6, mostly(0.3, 6), between[0]).significant_joints
    assert assessed(12, mostly(0.3, 12), between[0]).significant_joints
    alone = np.zeros((6, BLOCKS_OF_A_TAKE))
    alone[2] = 0.9
    assert not assessed(6, alone, between[0]).significant_joints


def one_of_five(share: float, p_value: float | None = None, others: float = 0.0) -> Assessment:
    """Of 12 takes; the four other joints are saved another share."""
    [mine], [other] = (assessed(12, mostly(each, 12)).errors for each in (share, others))
    return replace(
        assessed(12, mostly(share, 12), p_value),
        joints=("I_PIP", "M_PIP", "R_PIP", "P_PIP", "T_IP"),
        errors=(mine, *[other] * 4),
    )


def test_what_one_joint_alone_shows_is_undecided_before_it_is_named():
    for found, is_named in (
        (one_of_five(0.06), False),
        (one_of_five(0.06, others=0.06), True),
        (one_of_five(0.15), True),
        (one_of_five(0.3, p_value=0.01), False),
        (one_of_five(0.3, p_value=0.01, others=0.2), True),
        (one_of_five(0.3, p_value=0.003), True),
        (one_of_five(0.55, p_value=0.01), True),
    ):
        assert bool(found.significant_joints) is is_named
        assert found.as_of_many_takes.significant_joints


def test_one_joint_is_named_where_its_takes_say_so_too():
    in_two_takes = mostly(-0.01, 12)
    in_two_takes[::3] = 0.4
    found = assessed(12, in_two_takes)
    assert 0.08 < found.errors[0].contrast < 0.25
    assert not found.significant_joints
    assert assessed(12, mostly(found.errors[0].contrast, 12)).significant_joints


@pytest.mark.parametrize(("seed", "nuisance"), [(5085, "white"), (5117, "drift"), (70003, "drift")])
def test_a_healthy_glove_that_one_joint_spoke_against_has_nothing_named(seed, nuisance):
    """Each had hysteresis, warmup_drift, donning_shift named before (2026-11-28)."""
    takes = record_session(SessionPlan(seed=seed, rate_hz=100.0, nuisance=nuisance)).takes
    assert diagnose(takes, LAYOUT, judge_residual=False).named is None


def test_what_few_takes_show_faintly_asks_for_more_takes():
    plan = SessionPlan(seed=4, wearings=2, takes_per_wearing=3, take_s=20.0)
    takes = record_session(plan, [Cause("hysteresis", "single_play", 0.6, ("I_PIP",))]).takes
    found = diagnose(takes, LAYOUT)
    assert found.named is None
    reason = "6 takes are too few to tell what may be saved from chance: record 6 more takes"
    assert {item.effect for item in found.not_identifiable if item.why == reason} == {"hysteresis", "lag"}
    assert found.take_plan is not None
    assert {"hysteresis", "lag"} <= set(found.take_plan.opens)
    assert sum(step.takes for step in found.take_plan.steps) == 6
    assert found.take_plan.heading in diagnosis_sentences(found)
    assert found.next_take is not None
    assert found.next_take.separates == ("hysteresis", "lag", "chance")


def test_takes_that_a_faint_cause_may_move_apart_contradict_no_reference():
    plan = SessionPlan(seed=5004, wearings=3, takes_per_wearing=4, take_s=20.0)
    every = record_session(plan, [Cause("temperature", "quadratic", 3.0)]).takes
    found = diagnose([take for number, take in enumerate(every) if number % 4 < 3], LAYOUT)
    assert found.named is None
    assert {item.effect for item in found.not_identifiable} >= {"temperature"}
    assert found.reference_problems == ()
