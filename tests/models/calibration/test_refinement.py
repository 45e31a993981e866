"""Refinement by hand: a scale and an offset on a line, taken back exactly; nothing else is touched."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glovecal_models.calibration.artifact import dump, load
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.refinement import HOW, Refinement, refinable, refined
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.errors import BadInput
from glovecal_models.layout import Layout
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan

SENSORS = ("I_MCP", "I_PIP")
LAYOUT = Layout.from_columns("two", SENSORS, SENSORS)
TAKES = record_session(
    SessionPlan(seed=2, sensors=SENSORS, wearings=1, takes_per_wearing=2, take_s=10.0)
).takes


def trained(method: str) -> CalibrationModel:
    settings = TrainingSettings(method=method, samples=200, folds=0)  # pyright: ignore[reportArgumentType]
    return train(TAKES, LAYOUT, "anna", settings)


LINEAR = trained("linear")
READINGS = TAKES[0].readings[:50]


@settings(max_examples=50)
@given(st.floats(0.5, 2.0), st.floats(-90, 90))
def test_an_angle_is_scaled_and_shifted_and_comes_back(scale, offset_deg):
    change = Refinement(scale, offset_deg)
    child = refined(LINEAR, {"I_PIP": change}, "p")
    before, after = (GlovePredictor(model).predict(READINGS) for model in (LINEAR, child))
    place = LINEAR.rotation_names.index("I_PIP")
    assert after.mean[:, place] == pytest.approx(scale * before.mean[:, place] + offset_deg, abs=1e-9)
    assert after.sd[:, place] == pytest.approx(scale * before.sd[:, place])
    assert np.array_equal(np.delete(after.mean, place, 1), np.delete(before.mean, place, 1))
    back = GlovePredictor(refined(child, {"I_PIP": change.inverse})).predict(READINGS)
    assert back.mean == pytest.approx(before.mean, abs=1e-7)


def test_the_child_says_what_it_is_and_survives_being_stored():
    child = load(dump(refined(LINEAR, {"I_MCP": Refinement(1.1, 2.0)}, "p")))
    assert child.parent == "p"
    assert child.error_estimate == {"how": HOW}
    assert child.takes == LINEAR.takes
    [changed] = [item for item in child.rotations if item.rotation == "I_MCP"]
    assert changed.held_out_rmse_deg is None
    assert changed.regressor.settings()["evidence"]["refined_by_hand"] is True


def test_only_lines_are_refined():
    assert refinable(LINEAR) == LINEAR.rotation_names
    curved = trained("lmc_gpr")
    assert refinable(curved) == ()
    with pytest.raises(BadInput, match=r"I_PIP is .*, no line"):
        refined(curved, {"I_PIP": Refinement()})
    with pytest.raises(BadInput, match="no rotation 'T_IP'"):
        refined(LINEAR, {"T_IP": Refinement()})
    with pytest.raises(BadInput, match="no rotation is to be refined"):
        refined(LINEAR, {})


@pytest.mark.parametrize(
    ("scale", "offset_deg"), [(0.0, 0.0), (-1.0, 0.0), (np.nan, 0.0), (1.0, 200.0), (1.0, np.nan)]
)
def test_a_wild_refinement_is_refused(scale, offset_deg):
    with pytest.raises(BadInput, match="must be"):
        Refinement(scale, offset_deg)
