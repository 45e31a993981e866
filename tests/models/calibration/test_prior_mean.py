"""A linear model as the mean of LMC-GPR: what samples say stays, elsewhere the prior speaks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.calibration.artifact import dump, load
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.template import fit_on_plane, planes_of
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import PriorPlane, TrainingSettings
from glovecal_models.errors import BadInput
from glovecal_models.simulation.protocol import evaluation_segment
from glovecal_models.simulation.simulated_glove import SimulatedGlove, simulate_take

PLANE = PriorPlane("I_MCP", ("I_MCP",), (0.8,), -50.0)


def curve(readings: np.ndarray) -> np.ndarray:
    return 0.8 * readings - 50 + 4 * np.sin(readings / 12)


def test_far_from_all_samples_the_prior_speaks_and_near_them_the_samples() -> None:
    random = np.random.default_rng(1)
    readings = random.uniform(60, 110, (150, 1))
    target = curve(readings[:, 0]) + 0.3 * random.standard_normal(150)
    process = fit_on_plane(readings, target, ("I_MCP",), PLANE)
    seen = np.linspace(65, 105, 20)[:, None]
    np.testing.assert_allclose(process.mean(seen), curve(seen[:, 0]), atol=0.6)
    far = process.predict(np.array([[230.0]]))
    assert far.mean[0] == pytest.approx(0.8 * 230 - 50, abs=6.0)
    assert far.variance[0] > 4 * process.predict(seen).variance.max()


def test_a_prior_that_reads_another_sensor_brings_it_along() -> None:
    glove = SimulatedGlove(4)
    take = simulate_take(glove, evaluation_segment(4), seed=4, rate_hz=20).take
    few = replace(
        glove.layout, correspondences=tuple(c for c in glove.layout.correspondences if c.rotation == "P_MCP")
    )
    plane = PriorPlane("P_MCP", ("P_MCP", "PALM_ARCH"), (0.9, 0.1), -60.0)
    settings = TrainingSettings(samples=80, folds=0, prior=(plane,))
    model = train([take], few, "anna", settings)
    (item,) = model.rotations
    assert item.correspondence.sensors == ("P_MCP", "PALM_ARCH")
    again = load(dump(model))
    before, after = (GlovePredictor(each).predict(take.readings[:9]).mean for each in (model, again))
    np.testing.assert_array_equal(before, after)
    off = GlovePredictor(model).predict(take.readings).mean[:, 0] - take.reference_at_frames(["P_MCP"])[:, 0]
    assert np.sqrt(np.mean(off**2)) < 2.5


def test_planes_are_those_of_a_linear_model_only() -> None:
    glove = SimulatedGlove(4)
    take = simulate_take(glove, evaluation_segment(4), seed=4, rate_hz=20).take
    template = train([take], glove.layout, "anna", TrainingSettings(method="template", folds=0))
    planes = {plane.rotation: plane for plane in planes_of(template)}
    assert planes["TI_ABD"].sensors == ("TI_ABD", "PALM_ARCH")
    readings = take.readings[:1]
    x = dict(zip(glove.layout.sensors, readings[0], strict=True))
    said = sum(
        gain * x[name] for gain, name in zip(planes["TI_ABD"].gains, planes["TI_ABD"].sensors, strict=True)
    )
    column = template.rotation_names.index("TI_ABD")
    expected = GlovePredictor(template).predict(readings).mean[0, column]
    assert said + planes["TI_ABD"].offset_deg == pytest.approx(expected)
    empty = replace(template, rotations=())
    with pytest.raises(BadInput, match="is no prior mean"):
        planes_of(empty)
    with pytest.raises(BadInput, match="for method lmc_gpr, not for spgp"):
        TrainingSettings(method="spgp", prior=tuple(planes.values()))
    with pytest.raises(BadInput, match="reads PALM_ARCH"):
        fit_on_plane(readings, readings[:, 0], ("TI_ABD",), planes["TI_ABD"])
