"""The control of an effect learns a form where the effect does, and still cannot be right."""

from dataclasses import replace

import pytest

from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.effects.catalogue import stored_correction
from glovecal_models.improvement.add_effect import add_effect
from glovecal_models.improvement.addition import share_left_by_control, total_rmse_deg
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan

SENSORS = ("I_MCP", "M_MCP", "R_MCP")
SETTINGS = TrainingSettings(samples=300, folds=3)


@pytest.fixture(scope="module")
def one_sided():
    """A simulated glove, its layout, and a calibration without the coupling."""
    plan = SessionPlan(seed=11, sensors=SENSORS, wearings=2, takes_per_wearing=3, take_s=25.0)
    takes = record_session(plan, (Cause("cross_coupling", "one_sided", strength_deg=3.0),)).takes
    layout = Layout.from_document(
        {"name": "three", "sensors": list(SENSORS), "rotations": {name: [name] for name in SENSORS}}
    )
    return takes, train(takes, layout, "anna", replace(SETTINGS, folds=0))


def test_a_control_with_a_form_is_beaten_by_what_is_there(one_sided):
    takes, model = one_sided
    added = add_effect(model, takes, "cross_coupling", settings=SETTINGS)
    assert added.added
    assert any(item.curves for item in added.model.effects), "this glove asks for a form"
    share = added.control_share
    assert share is not None
    before, after = (total_rmse_deg(part, added.rotations) for part in (added.before, added.after))
    assert after / before < share <= 1.0


def test_a_form_never_makes_the_control_look_worse(one_sided):
    takes, model = one_sided
    coupling = stored_correction("cross_coupling", {})
    plain = share_left_by_control(model, takes, coupling, SENSORS)
    formed = share_left_by_control(model, takes, coupling, SENSORS, known_share=plain, has_form=True)
    assert plain is not None
    assert formed is not None
    assert formed <= plain <= 1.0
