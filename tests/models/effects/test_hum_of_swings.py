"""What swings of a joint leave in a sensor's errors is no hum."""

from __future__ import annotations

import pytest

from glovecal_models.effects.sensor_fault.sensor_fault import SensorFault
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan

FAULT = SensorFault()


@pytest.mark.parametrize("seed", [0, 5])
def test_fast_swings_of_a_glove_that_is_late_are_no_hum(seed):
    """The take that tells a lag from a latency."""
    choices = {"rate_hz": 100.0, "nuisance": "white", "wearings": 2, "takes_per_wearing": 2, "take_s": 25.0}
    plan = SessionPlan(seed=seed, **choices)
    session = record_session(plan, [Cause("glove_latency", "transport_delay", strength_deg=1.0)])
    takes = [*session.takes, session.also("fast", 45.0, 1).take]
    assert FAULT.find(takes, {name: name for name in plan.sensors}) == ()
