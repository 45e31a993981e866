"""What training or a file gives can be served: rules that were never measured, and numbers nobody can use."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.calibration.artifact import dump, load
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.servable import WearerFit, check_servable
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.errors import BadInput
from glovecal_models.layout import Layout
from glovecal_models.regression.linear_regressor import line_of
from glovecal_models.takes.take import Take

LAYOUT = Layout.from_toml("""
name = "bend-and-rule"
sensors = ["I_MCP", "I_PIP"]
counts = [0, 255]
[rotations]
I_MCP = ["I_MCP"]
I_PIP = ["I_PIP"]
[simulated]
I_DIP = "2/3 * I_PIP"
""")


def trained(measured: tuple[str, ...]) -> CalibrationModel:
    readings = np.random.default_rng(0).uniform(20.0, 230.0, (200, 2))
    time_s = np.arange(200) / 100.0
    angles = {"I_MCP": readings[:, 0] / 3, "I_PIP": readings[:, 1] / 3, "I_DIP": readings[:, 1] / 4.5}
    reference = np.column_stack([angles[name] for name in measured])
    take = Take("t", "w", LAYOUT.sensors, time_s, readings, measured, time_s, reference)
    return train([take], LAYOUT, "anna", TrainingSettings(method="linear", folds=0))


@pytest.mark.parametrize("measured", [("I_MCP", "I_PIP"), ("I_MCP", "I_PIP", "I_DIP"), ("I_PIP",)])
def test_a_rotation_by_rule_may_be_measured_or_not(measured: tuple[str, ...]) -> None:
    model = load(dump(trained(measured)))
    fit = WearerFit(model, GlovePredictor(model))
    assert fit.low[1] == pytest.approx(20, abs=5)
    assert fit.high[1] == pytest.approx(230, abs=5)
    frame = np.array([[100.0, 100.0]])
    assert not fit.misfit(frame, GlovePredictor(model).predict(frame).mean).is_clear


@pytest.mark.parametrize("gain", [1e45, 1e308, -1e6])
def test_a_model_whose_angles_no_pose_can_hold_is_not_kept(gain: float) -> None:
    model = trained(("I_MCP", "I_PIP"))
    first, *others = model.rotations
    wild = replace(first, regressor=line_of([gain], 0.0, 5.0, {"trainer": "imported"}))
    with pytest.raises(BadInput, match=f"gives {first.rotation} an angle of"):
        dump(replace(model, rotations=(wild, *others)))


def test_a_model_that_fails_on_a_frame_tells_no_exception() -> None:
    model = trained(("I_MCP", "I_PIP"))
    first, *others = model.rotations
    broken = replace(first, input_low=np.zeros(3), input_high=np.ones(3))
    with pytest.raises(BadInput) as refused:
        check_servable(replace(model, rotations=(broken, *others)))
    assert str(refused.value) == "the model does not predict a frame of its own layout"
