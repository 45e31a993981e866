"""A slow cause that firmware corrects by a coarse table: named, repaired, and stored with its steps."""

from __future__ import annotations

import numpy as np
import pytest
from further_forms import every_form

from glovecal_models.calibration.artifact import dump, load
from glovecal_models.calibration.training_settings import TrainingSettings, requested_effects
from glovecal_models.diagnosis import column_forms
from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.text import candidate_sentence
from glovecal_models.effects.base.column_steps import IN_STEPS, ColumnSteps, StepSearch
from glovecal_models.improvement.improve import improve
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import FIVE_SENSORS, SessionPlan

LAYOUT = Layout.from_columns("five", FIVE_SENSORS, FIVE_SENSORS)


def recorded(cause: str, form: str, seed: int):
    plan = SessionPlan(seed=seed, bits=12, nuisance="white", take_s=40.0)
    return record_session(plan, [Cause(cause, form, 2.0)], forms_of=every_form).takes


@pytest.mark.parametrize(
    ("cause", "form", "seed"),
    [("temperature", "corrected_in_steps", 11), ("supply_sag", "coarsely_corrected", 13)],
)
def test_steps_are_named_by_their_column_and_told(cause, form, seed):
    found = diagnose(recorded(cause, form, seed), LAYOUT, judge_residual=False)
    assert found.named is not None
    assert found.named.effect == cause
    first = found.naming.ranked[0]
    assert isinstance(first.steps, ColumnSteps)
    assert "equal steps of" in candidate_sentence(first)
    assert first.p_value is not None
    assert first.p_value < 0.01
    assert all(item.control_saved <= 0 for item in first.errors)


def test_they_are_repaired_and_a_stored_model_keeps_them():
    takes = recorded("temperature", "corrected_in_steps", 11)
    found = improve(takes, LAYOUT, "simulated", TrainingSettings(method="linear"))
    first = found.steps[1]
    assert first.added is not None
    assert first.added.effect == "temperature"
    assert first.rmse_deg < 0.85 * found.steps[0].rmse_deg
    assert found.steps[-1].rmse_deg < 0.6 * found.steps[0].rmse_deg  # with the base's own curve
    model = first.model
    added = next(item for item in model.effects if item.name == "temperature")
    assert IN_STEPS in added.settings
    again = load(dump(model))
    assert again.effects[0].settings == added.settings
    assert requested_effects(again)[0].settings == {IN_STEPS: added.settings[IN_STEPS]}
    assert added.form is None


def test_a_take_without_which_the_column_never_changes_is_predicted_by_no_steps():
    column = np.full((12, 8), 20.0)
    column[4] = np.linspace(20.0, 24.0, 8)
    errors, columns = np.random.default_rng(0).standard_normal((2, 12, 8)), list(column)
    found = column_forms._within_without(StepSearch(column), errors, columns)
    assert not np.concatenate(found[4]).any()
    assert np.concatenate(found[3]).any()


def test_wearings_that_sit_otherwise_are_no_steps_of_a_column():
    found = diagnose(recorded("donning_shift", "offset_and_gain", 2), LAYOUT, judge_residual=False)
    assert found.named is not None
    assert found.named.effect == "donning_shift"
    assert not any(item.steps and item.significant_joints for item in found.assessments)
