"""Regressors and effects, fitted in turns, end where both agree: predictions have no bias left."""

from __future__ import annotations

import numpy as np
import pytest
from further_forms import every_form

from glovecal_models.calibration.added_effect import EffectRequest
from glovecal_models.calibration.effect_fit import (
    NOISE_SHARE,
    correspondence_for,
    fit_with_effects,
    with_new_weights,
)
from glovecal_models.calibration.fitted_effects import fitted_effects
from glovecal_models.calibration.leave_out import frame_errors_of
from glovecal_models.calibration.prepared_takes import OwnSignal, PreparedTakes
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.effects.catalogue import effect
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan

SENSORS = ("I_PIP", "M_PIP")


@pytest.fixture(scope="module")
def takes() -> PreparedTakes:
    """A large creep whose form moves the regressors as well: its structure is lost while bent."""
    plan = SessionPlan(
        seed=11, sensors=SENSORS, bits=12, nuisance="white", wearings=2, takes_per_wearing=4, take_s=40.0
    )
    layout = Layout.from_document(
        {"name": "two", "sensors": list(SENSORS), "rotations": {name: [name] for name in SENSORS}}
    )
    session = record_session(plan, (Cause("creep", "lost_structure", 2.5),), forms_of=every_form)
    return PreparedTakes.of(session.takes, layout)


def test_what_is_predicted_has_no_bias_in_training(takes: PreparedTakes) -> None:
    settings = TrainingSettings(folds=0, samples=300)
    fit = fit_with_effects(takes, SENSORS, [EffectRequest(effect("creep"), SENSORS)], settings)
    errors = np.concatenate(frame_errors_of(fit, takes, SENSORS, settings))
    rmse = np.sqrt(np.nanmean(errors**2, axis=0))
    assert np.all(np.abs(np.nanmean(errors, axis=0)) < NOISE_SHARE * rmse)


def test_new_weights_on_the_same_base_are_the_old_ones(takes: PreparedTakes) -> None:
    settings = TrainingSettings(folds=0, samples=300)
    base = fit_with_effects(takes, SENSORS, [], settings)
    columns = {name: correspondence_for(takes, name, settings) for name in SENSORS}
    own = {name: OwnSignal.of(takes, columns[name], base.regressor(name)) for name in SENSORS}
    wanted = [EffectRequest(effect("creep"), SENSORS)]
    first = fitted_effects(takes, columns, own, wanted, is_linear=False, is_last=True, cancelled=None)
    again = with_new_weights(first, takes, columns, own, is_linear=False)
    assert first[0].form is not None
    assert first[0].covariance is not None
    assert again[0].covariance is not None
    assert again[0].weights == pytest.approx(first[0].weights, rel=1e-6, abs=1e-9)
    assert again[0].covariance == pytest.approx(first[0].covariance, rel=1e-6, abs=1e-9)
    assert again[0].settings == first[0].settings
