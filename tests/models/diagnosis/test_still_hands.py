"""Where nothing moves nothing is told."""

from __future__ import annotations

from dataclasses import replace

import pytest

from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.next_take import STILL_HAND
from glovecal_models.diagnosis.text import diagnosis_sentences
from glovecal_models.layout import Layout
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import FIVE_SENSORS, SessionPlan
from glovecal_models.takes.take import Take

LAYOUT = Layout.from_columns("five", FIVE_SENSORS, FIVE_SENSORS)


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
