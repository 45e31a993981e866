"""What a control in a learned form leaves, beside an effect that the model has already."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_models.diagnosis.candidates import formed_rmse
from glovecal_models.diagnosis.known_effect import KnownEffect
from glovecal_models.diagnosis.problem import DiagnosisProblem
from glovecal_models.effects.base.learned_form import FormTerm
from glovecal_models.effects.catalogue import stored_correction
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan

SENSORS = ("I_MCP", "R_MCP")


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_form_that_the_model_has_keeps_its_prior_in_the_base(seed):
    """Free weights of its columns would run away on takes held out: the base to beat would be no base."""
    plan = SessionPlan(seed=seed, sensors=SENSORS, wearings=3, takes_per_wearing=3, take_s=15.0)
    takes = record_session(plan, [Cause("temperature", "late", 2.0)]).takes
    term = FormTerm(("temperature_c", "slope of temperature_c"), 0.4, 6.0)
    known = KnownEffect(stored_correction("temperature", {}), SENSORS, (np.empty(0),) * 2, ((term,),) * 2)
    layout = Layout.from_columns("two", SENSORS, SENSORS)
    design = DiagnosisProblem.of(takes, layout, False, (known,)).design()
    found = formed_rmse(design, stored_correction("supply_sag", {}), 0)
    assert found is not None
    assert found.before < 1.5 * np.sqrt(design.mean_square()["I_MCP"])
