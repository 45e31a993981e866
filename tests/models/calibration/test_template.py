"""Template calibration: the paper's equations found again by training, and beside an independent solution."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.calibration.artifact import dump, load
from glovecal_models.calibration.methods import Method
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.template import PALM_SHARE
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_plan import plan_training
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.errors import NotTrainable
from glovecal_models.layout import Layout
from glovecal_models.regression.linear_regressor import LinearRegressor, fit_beside, gains_of, line_of
from glovecal_models.simulation.protocol import evaluation_segment
from glovecal_models.simulation.simulated_glove import SimulatedGlove, simulate_take
from glovecal_models.takes.take import Take

LAYOUT = Layout.built_in("cyberglove18")
OWN = [name for name in LAYOUT.sensors if not name.startswith("W_")]
GAIN = {name: 0.5 + 0.05 * place for place, name in enumerate(OWN)} | {"IM_ABD": -0.4}
OFFSET = {name: -40.0 - place for place, name in enumerate(OWN)}
PALM_TO_THUMB = -0.17


def followed(readings: np.ndarray) -> dict[str, np.ndarray]:
    """Angles (N,) by equations (1) to (5), written out again here."""
    x = dict(zip(LAYOUT.sensors, readings.T, strict=True))
    angles = {name: GAIN[name] * x[name] + OFFSET[name] for name in OWN}
    angles["P_MCP"] = angles["P_MCP"] + 0.75 * angles["PALM_ARCH"]
    angles["TI_ABD"] = angles["TI_ABD"] + PALM_TO_THUMB * x["PALM_ARCH"]
    return angles


def taken(names: list[str], noise_deg: float = 0.0, count: int = 300, seed: int = 1) -> list[Take]:
    """Two takes of random readings with the angles of ``names`` measured."""
    random = np.random.default_rng(seed)
    takes = []
    for number in range(2):
        readings = random.uniform(40, 200, (count, len(LAYOUT.sensors)))
        angles = followed(readings)
        reference = np.column_stack([angles[name] for name in names])
        time = np.arange(count) / 30
        takes.append(
            Take(
                name=f"t{number}",
                wearing="monday",
                sensors=LAYOUT.sensors,
                time_s=time,
                readings=readings,
                rotations=tuple(names),
                reference_time_s=time,
                reference=reference + noise_deg * random.standard_normal(reference.shape),
            )
        )
    return takes


def planes(model: CalibrationModel) -> dict[str, tuple[np.ndarray, float]]:
    found = {}
    for item in model.rotations:
        if isinstance(item.regressor, LinearRegressor):
            found[item.rotation] = gains_of(item.regressor)
    return found


def trained(takes: list[Take], method: Method = "template", folds: int = 0) -> CalibrationModel:
    return train(takes, LAYOUT, "anna", TrainingSettings(method=method, folds=folds))


def test_every_scale_and_offset_is_found_again() -> None:
    found = planes(trained(taken(OWN)))
    for name in OWN:
        gains, offset = found[name]
        assert gains[0] == pytest.approx(GAIN[name], abs=1e-9)
        if name not in ("P_MCP", "TI_ABD"):
            assert len(gains) == 1
            assert offset == pytest.approx(OFFSET[name], abs=1e-6)
    gains, offset = found["P_MCP"]
    assert gains[1] == pytest.approx(0.75 * GAIN["PALM_ARCH"], abs=1e-9)
    assert offset == pytest.approx(OFFSET["P_MCP"] + 0.75 * OFFSET["PALM_ARCH"], abs=1e-6)
    assert found["TI_ABD"][0][1] == pytest.approx(PALM_TO_THUMB, abs=1e-9)


def test_noisy_samples_give_what_another_least_squares_gives() -> None:
    takes = taken(OWN, noise_deg=3.0)
    found = planes(trained(takes))
    readings = np.concatenate([take.readings for take in takes])
    target = dict(zip(OWN, np.concatenate([take.reference for take in takes]).T, strict=True))
    x = dict(zip(LAYOUT.sensors, readings.T, strict=True))
    palm = np.polyfit(x["PALM_ARCH"], target["PALM_ARCH"], 1)
    own = np.polyfit(x["P_MCP"], target["P_MCP"] - PALM_SHARE * palm[0] * x["PALM_ARCH"], 1)
    gains, offset = found["P_MCP"]
    np.testing.assert_allclose([*gains, offset], [own[0], PALM_SHARE * palm[0], own[1]], rtol=1e-6)
    basis = np.column_stack([x["TI_ABD"], x["PALM_ARCH"], np.ones(len(readings))])
    expected = np.linalg.lstsq(basis, target["TI_ABD"], rcond=None)[0]
    gains, offset = found["TI_ABD"]
    np.testing.assert_allclose([*gains, offset], expected, rtol=1e-6)


def test_without_a_measured_palm_the_little_finger_follows_its_own_sensor_alone() -> None:
    names = [name for name in OWN if name != "PALM_ARCH"]
    model = trained(taken(names))
    assert (model.palm, trained(taken(OWN)).palm) == ("rigid", "arching")
    assert "PALM_ARCH" not in model.rotation_names
    assert planes(model)["P_MCP"][0][1] == 0.0


def test_a_fold_knows_only_the_palm_of_its_own_takes() -> None:
    takes = taken(OWN)
    wrong = takes[1].reference.copy()
    wrong[:, OWN.index("PALM_ARCH")] *= 3
    plan = plan_training([takes[0], replace(takes[1], reference=wrong)], LAYOUT, "anna",
                         TrainingSettings(method="template", folds=2))  # fmt: skip
    gains = {task.fold: task.known_gain or 0.0 for task in plan.tasks if task.rotation == "P_MCP"}
    right, tripled = 0.75 * GAIN["PALM_ARCH"], 2.25 * GAIN["PALM_ARCH"]
    assert sorted([gains[0], gains[1]]) == pytest.approx([right, tripled])
    assert right < gains[None] < tripled
    assert all(task.known_gain is None for task in plan.tasks if task.rotation != "P_MCP")


def test_last_joints_are_interpolated_for_18_sensors_and_read_for_22() -> None:
    for name, read in (("cyberglove18", False), ("cyberglove22", True)):
        glove = SimulatedGlove(1, name)
        take = simulate_take(glove, evaluation_segment(2), seed=2, rate_hz=20).take
        names = tuple(each for each in take.rotations if read or not each.endswith("DIP"))
        columns = [take.rotations.index(each) for each in names]
        take = replace(take, rotations=names, reference=take.reference[:, columns])
        model = train([take], glove.layout, "anna", TrainingSettings(method="template", folds=0))
        (last,) = [item for item in model.rotations if item.rotation == "I_DIP"]
        assert last.correspondence.sensors == (("I_DIP",) if read else ("I_PIP",))
        angles = GlovePredictor(model).predict(take.readings[:5])
        if not read:
            by_name = dict(zip(model.rotation_names, angles.mean.T, strict=True))
            np.testing.assert_allclose(by_name["I_DIP"], 2 / 3 * by_name["I_PIP"], atol=1e-9)


def test_it_is_stored_like_any_model() -> None:
    takes = taken(OWN, noise_deg=1.0)
    model = trained(takes, folds=2)
    again = load(dump(model))
    assert again.method == "template"
    readings = takes[0].readings[:20]
    np.testing.assert_array_equal(
        GlovePredictor(model).predict(readings).mean, GlovePredictor(again).predict(readings).mean
    )
    assert model.error_estimate["rmse_deg"] == pytest.approx(1.0, rel=0.1)


def test_two_shapes_give_the_line_through_both() -> None:
    take = simulate_take(SimulatedGlove(3), evaluation_segment(3), seed=3, rate_hz=60).take
    model = train([take], LAYOUT, "anna", TrainingSettings(method="two_shapes", folds=0))
    predictor, poses = GlovePredictor(model), np.array(take.poses)
    for name in ("I_MCP", "I_PIP", "T_TMC"):
        column = model.rotation_names.index(name)
        for pose in ("flat", "ok"):
            rows = poses == pose
            mean = predictor.predict(take.readings[rows]).mean[:, column].mean()
            assert mean == pytest.approx(take.reference_at_frames([name])[rows].mean(), abs=0.3)


def test_two_shapes_says_which_shape_was_not_taken() -> None:
    with pytest.raises(
        NotTrainable, match=r"of one of the two shapes, flat and touch-I or ok; poses .*: none"
    ):
        trained(taken(OWN), "two_shapes")


def test_a_line_of_known_numbers_says_them_again() -> None:
    gains, offset = gains_of(line_of([0.5, -2.0], 7.0, 3.0, {}))
    np.testing.assert_array_equal(gains, [0.5, -2.0])
    assert offset == 7.0
    random = np.random.default_rng(4)
    inputs = random.uniform(0, 255, (40, 2))
    target = 0.3 * inputs[:, 0] + 0.2 * inputs[:, 1] - 5
    gains, offset = gains_of(fit_beside(inputs, target, 0.2))
    np.testing.assert_allclose([*gains, offset], [0.3, 0.2, -5.0], atol=1e-9)
