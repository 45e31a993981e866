"""How much evidence a name needs: blocks enough, more than one take that tells it, and a hand that moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.next_take import STILL_HAND
from glovecal_models.diagnosis.text import diagnosis_sentences
from glovecal_models.effects.base.assessment import Assessment, JointErrors
from glovecal_models.layout import Layout
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import FIVE_SENSORS, SessionPlan
from glovecal_models.takes.take import Take

LAYOUT = Layout.from_columns("five", FIVE_SENSORS, FIVE_SENSORS)


def found(saved: np.ndarray, blocks_of_a_take: int = 4) -> Assessment:
    """Of an effect that saves such shares of each block on the only joint."""
    base = np.full(len(saved), 100.0)
    take = np.arange(len(saved)) // blocks_of_a_take
    errors = JointErrors(base, base * (1.0 - saved), base * 1.01, 100 * len(saved), take)
    return Assessment("creep", ("I_MCP",), (errors,), (np.empty(0),), (np.empty(0),))


def scattered(count: int, mean: float) -> np.ndarray:
    return mean + 0.02 * np.random.default_rng(3).standard_normal(count)


def test_an_effect_that_all_takes_tell_is_significant() -> None:
    assert found(scattered(24, 0.1)).significant_joints == (0,)


def test_one_take_is_not_enough() -> None:
    """Six blocks of one take save much, all others as often cost as save."""
    rest = 0.02 * np.resize([1.0, -1.0], 30)
    assert not found(np.concatenate([np.full(6, 0.9), rest]), 6).significant_joints


def test_few_blocks_have_to_save_much() -> None:
    assert not found(scattered(12, 0.1)).significant_joints
    assert found(scattered(12, 0.6)).significant_joints == (0,)
    assert not found(scattered(8, 0.6)).significant_joints


def test_nothing_is_told_of_a_joint_that_hardly_moves() -> None:
    item = found(scattered(24, 0.1))
    assert not replace(item, still=(0,)).significant_joints


@pytest.fixture(scope="module")
def resting() -> tuple[Take, ...]:
    plan = SessionPlan(seed=5, wearings=2, takes_per_wearing=2, take_s=20.0, motions=("still",))
    return record_session(plan).takes


def test_a_hand_that_keeps_still_is_not_judged(resting: tuple[Take, ...]) -> None:
    diagnosis = diagnose(resting, LAYOUT)
    assert diagnosis.named is None
    assert not diagnosis.findings
    assert not diagnosis.assessments
    assert not diagnosis.residual.is_significant
    assert f"No effect is judged: {STILL_HAND}." in diagnosis_sentences(diagnosis)


def test_a_joint_that_moves_is_judged_beside_one_that_keeps_still(resting: tuple[Take, ...]) -> None:
    moving = record_session(SessionPlan(seed=5, wearings=2, takes_per_wearing=2, take_s=20.0)).takes
    mixed = []
    for still, take in zip(resting, moving, strict=True):
        readings, reference = take.readings.copy(), take.reference.copy()
        readings[:, 0], reference[:, 0] = still.readings[:, 0], still.reference[:, 0]
        mixed.append(replace(take, readings=readings, reference=reference))
    diagnosis = diagnose(mixed, LAYOUT, judge_residual=False)
    assert diagnosis.assessments
    assert all(item.still == (0,) for item in diagnosis.assessments)
