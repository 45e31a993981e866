"""A fold whose search begins at the optimum of all takes ends where a search of its own would."""

import numpy as np
import pytest

from glovecal_models.calibration import effect_fit
from glovecal_models.calibration.added_effect import EffectRequest
from glovecal_models.calibration.effect_fit import fit_with_effects
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.effects.catalogue import effect
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan

SENSORS = ("I_MCP", "I_PIP")
SETTINGS = TrainingSettings(samples=300)


@pytest.fixture(scope="module")
def takes() -> PreparedTakes:
    plan = SessionPlan(seed=11, sensors=SENSORS, wearings=2, takes_per_wearing=3, take_s=15.0)
    recorded = record_session(plan, (Cause("creep", strength_deg=2.5),)).takes
    return PreparedTakes.of(recorded, Layout.from_columns("two", SENSORS, SENSORS))


def test_a_fold_ends_where_a_cold_search_does(takes: PreparedTakes) -> None:
    whole = fit_with_effects(takes, SENSORS, [], SETTINGS)
    fold = takes.some(range(5))
    warm = fit_with_effects(fold, SENSORS, [], SETTINGS, optima=whole.optima)
    cold = fit_with_effects(fold, SENSORS, [], SETTINGS)
    for name in SENSORS:
        inputs = np.concatenate(takes.inputs(takes.layout.correspondence(name)))
        apart = warm.regressor(name).predict(inputs).mean - cold.regressor(name).predict(inputs).mean
        noise_deg = float(np.sqrt(cold.regressor(name).noise_variance))
        assert np.sqrt(np.mean(apart**2)) < 0.1 * noise_deg


def test_turns_end_when_one_more_changes_little(
    takes: PreparedTakes, monkeypatch: pytest.MonkeyPatch
) -> None:
    wanted = [EffectRequest(effect("creep"), SENSORS, {})]
    usual = fit_with_effects(takes, SENSORS, wanted, SETTINGS)
    assert len(usual.optima) <= effect_fit.MOST_TURNS + 2 + effect_fit.MOST_WEIGHT_TURNS
    monkeypatch.setattr(effect_fit, "SETTLED_SHARE", 0.0)
    monkeypatch.setattr(effect_fit, "MOST_TURNS", len(usual.optima) + 1)
    longer = fit_with_effects(takes, SENSORS, wanted, SETTINGS)
    assert len(longer.optima) > len(usual.optima)
    for name in SENSORS:
        inputs = np.concatenate(takes.inputs(takes.layout.correspondence(name)))
        apart = usual.regressor(name).predict(inputs).mean - longer.regressor(name).predict(inputs).mean
        assert np.sqrt(np.mean(apart**2)) < 0.5
