"""A straight line needs a curve first; what saturates is still named of what the curve leaves."""

from __future__ import annotations

import pytest

from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.improvement.improve import improve
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan

SENSORS = ("I_MCP", "I_PIP")


@pytest.mark.parametrize(("seed", "form"), [(11, "hard_clip"), (12, "narrow_window")])
def test_saturation_is_named_after_nonlinearity(seed, form):
    plan = SessionPlan(seed=seed, sensors=SENSORS, wearings=2, takes_per_wearing=3, take_s=25.0)
    cause = Cause("saturation", form, strength_deg=3.0, channels=("I_PIP",))
    document = {"name": "two", "sensors": list(SENSORS), "rotations": {name: [name] for name in SENSORS}}
    takes = record_session(plan, [cause]).takes
    settings = TrainingSettings(method="linear", samples=150)
    found = improve(list(takes), Layout.from_document(document), "anna", settings)
    added = [step.added.effect for step in found.steps if step.added is not None]
    assert added == ["nonlinearity", "saturation"]
