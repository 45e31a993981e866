"""GlovePredictor: the same numbers as each regressor alone, flags, rules, one frame or many."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glovecal_models.calibration.fused_processes import ROUNDED_SHARE
from glovecal_models.calibration.model import CalibrationModel, RotationModel
from glovecal_models.calibration.predictor import BY_RULE, EXTRAPOLATING, TOO_UNCERTAIN, GlovePredictor
from glovecal_models.covariance.functions import SquaredExponentialArd
from glovecal_models.errors import BadInput
from glovecal_models.layout import Layout
from glovecal_models.regression.linear_regressor import fit_linear
from glovecal_models.regression.regressor import ProcessRegressor, Regressor, RuleRegressor

LAYOUT = Layout.built_in("cyberglove18")
ROTATIONS = tuple(name for name in LAYOUT.rotations if name != "PALM_ARCH")


def make_process(dimensions: int, nodes: int, generator: np.random.Generator, terms: int = 1):
    """A process with sensible numbers; with two terms its covariance is a sum, which is not fused."""
    covariance = SquaredExponentialArd()
    for _ in range(terms - 1):
        covariance = covariance + SquaredExponentialArd()
    places = generator.standard_normal((nodes, dimensions))
    theta = np.tile(np.append(np.log(50.0 / terms), np.log(generator.uniform(0.3, 3, dimensions))), terms)
    gram = covariance(theta, places, places) + 0.5 * np.eye(nodes)
    root = np.linalg.inv(np.linalg.cholesky(gram)).T
    return ProcessRegressor(
        method="lmc_gpr",
        input_shift=np.full(dimensions, 128.0),
        input_scale=np.full(dimensions, 40.0),
        slope=generator.standard_normal(dimensions),
        intercept=3.0,
        covariance=covariance,
        theta=theta,
        nodes=places,
        weights=generator.standard_normal(nodes),
        variance_root=root,
        noise_variance=0.7,
        jitter=0.0,
    )


def make_model(seed: int = 0, sizes: tuple[int, ...] = (100,)) -> CalibrationModel:
    """Most rotations fused, W_FLEX a sum of covariances, W_ABD a plane, two DIP by rule (one of a rule)."""
    generator = np.random.default_rng(seed)
    items = []
    for number, name in enumerate(ROTATIONS):
        correspondence = LAYOUT.correspondence(name)
        dimensions = len(correspondence.inputs)
        regressor: Regressor = make_process(dimensions, sizes[number % len(sizes)], generator)
        if name == "W_FLEX":
            regressor = make_process(dimensions, 30, generator, terms=2)
        if name == "W_ABD":
            inputs = generator.uniform(0, 255, (50, dimensions))
            regressor = fit_linear(inputs, inputs @ np.ones(dimensions) + generator.standard_normal(50))
        if name == "I_DIP":
            regressor = RuleRegressor(("I_PIP",), np.array([2 / 3]))
        if name == "T_TMC":
            regressor = RuleRegressor(("I_DIP", "W_ABD"), np.array([0.5, -1.0]))
        low, high = (np.full(dimensions, value) for value in (55.0, 200.0))
        items.append(RotationModel(correspondence, regressor, low, high, 4.0, None, 50))
    return CalibrationModel(LAYOUT, "anna", "lmc_gpr", tuple(items), ())


@pytest.mark.parametrize("noise", [1.0, 1e-2, 1e-4])
def test_single_precision_costs_a_variance_a_hundredth_of_its_noise(noise: float) -> None:
    """The less noise the larger the root, and the more it magnifies rounding: then it stays double."""
    generator = np.random.default_rng(3)
    model = make_model(1, (60,))
    items = []
    for item in model.rotations:
        regressor = item.regressor
        if isinstance(regressor, ProcessRegressor) and isinstance(
            regressor.covariance, SquaredExponentialArd
        ):
            nodes = regressor.nodes * generator.uniform(0.1, 2)
            gram = regressor.covariance(regressor.theta, nodes, nodes) + noise * np.eye(len(nodes))
            root = np.linalg.inv(np.linalg.cholesky(gram)).T
            regressor = replace(regressor, nodes=nodes, variance_root=root, noise_variance=noise)
        items.append(replace(item, regressor=regressor))
    model = replace(model, rotations=tuple(items))
    readings = generator.uniform(20, 235, (50, 18))
    angles = GlovePredictor(model).predict(readings)
    for column, item in enumerate(model.rotations):
        if isinstance(item.regressor, ProcessRegressor):
            alone = item.regressor.predict(item.correspondence.input_columns(readings, LAYOUT.sensors))
            found = angles.sd[:, column] ** 2 - item.regressor.noise_variance
            assert np.abs(found - alone.variance).max() <= ROUNDED_SHARE * noise


@pytest.mark.parametrize("sizes", [(100,), (3, 9, 12, 40, 130, 300), (7,)])
@pytest.mark.parametrize("frames", [1, 5, 16, 300])
def test_equals_each_regressor_alone(sizes: tuple[int, ...], frames: int) -> None:
    model = make_model(1, sizes)
    predictor = GlovePredictor(model)
    assert predictor.rotations == ROTATIONS
    readings = np.random.default_rng(2).uniform(20, 235, (frames, 18))
    angles = predictor.predict(readings)
    for column, item in enumerate(model.rotations):
        if isinstance(item.regressor, RuleRegressor):
            continue
        alone = item.regressor.predict(item.correspondence.input_columns(readings, LAYOUT.sensors))
        np.testing.assert_allclose(angles.mean[:, column], alone.mean, atol=1e-9, rtol=0)
        sd = np.sqrt(alone.variance + item.regressor.noise_variance)
        np.testing.assert_allclose(angles.sd[:, column], sd, atol=1e-4, rtol=0)
        uncertain = np.sqrt(alone.variance) > item.uncertain_above_deg
        np.testing.assert_array_equal(angles.flags[:, column] & TOO_UNCERTAIN > 0, uncertain)


def test_nodes_that_serve_the_mean_only() -> None:
    model = make_model(6, (300,))
    items = []
    for item in model.rotations:
        regressor = item.regressor
        if isinstance(regressor, ProcessRegressor) and len(regressor.nodes) == 300:
            root = regressor.variance_root.copy()
            root[200:] = 0.0
            items.append(replace(item, regressor=replace(regressor, variance_root=root)))
        else:
            items.append(item)
    model = replace(model, rotations=tuple(items))
    readings = np.random.default_rng(2).uniform(20, 235, (9, 18))
    angles = GlovePredictor(model).predict(readings)
    for column, item in enumerate(model.rotations):
        if not isinstance(item.regressor, RuleRegressor):
            alone = item.regressor.predict(item.correspondence.input_columns(readings, LAYOUT.sensors))
            np.testing.assert_allclose(angles.mean[:, column], alone.mean, atol=1e-9, rtol=0)
            sd = np.sqrt(alone.variance + item.regressor.noise_variance)
            np.testing.assert_allclose(angles.sd[:, column], sd, atol=2e-3, rtol=0)  # single precision


def test_frame_by_frame_equals_all_at_once() -> None:
    predictor = GlovePredictor(make_model(3, (5, 60)))
    readings = np.random.default_rng(4).uniform(0, 255, (700, 18))
    together = predictor.predict(readings)
    for frame in range(0, 700, 70):
        alone = predictor.predict(readings[frame : frame + 1])
        np.testing.assert_allclose(alone.mean[0], together.mean[frame], atol=1e-10)
        np.testing.assert_allclose(alone.sd[0], together.sd[frame], atol=1e-4)
        np.testing.assert_array_equal(alone.flags[0], together.flags[frame])


def test_results_are_not_overwritten_by_the_next_call() -> None:
    predictor = GlovePredictor(make_model())
    first = predictor.predict(np.full((1, 18), 100.0))
    kept = first.mean.copy(), first.sd.copy(), first.flags.copy()
    predictor.predict(np.full((1, 18), 140.0))
    np.testing.assert_array_equal(first.mean, kept[0])
    np.testing.assert_array_equal(first.sd, kept[1])
    np.testing.assert_array_equal(first.flags, kept[2])


def test_rules_follow_their_sources_even_through_another_rule() -> None:
    predictor = GlovePredictor(make_model())
    angles = predictor.predict(np.random.default_rng(5).uniform(60, 190, (4, 18)))
    at = {name: column for column, name in enumerate(predictor.rotations)}
    dip, pip, wrist, thumb = (at[name] for name in ("I_DIP", "I_PIP", "W_ABD", "T_TMC"))
    np.testing.assert_allclose(angles.mean[:, dip], 2 / 3 * angles.mean[:, pip], atol=1e-12)
    expected = 0.5 * angles.mean[:, dip] - angles.mean[:, wrist]
    np.testing.assert_allclose(angles.mean[:, thumb], expected, atol=1e-12)
    np.testing.assert_allclose(angles.sd[:, dip], 2 / 3 * angles.sd[:, pip], atol=1e-12)
    assert (angles.flags[:, [dip, thumb]] & BY_RULE).all()
    assert not (angles.flags[:, [pip, wrist]] & BY_RULE).any()


def test_extrapolation_begins_five_percent_outside_the_training_range() -> None:
    predictor = GlovePredictor(make_model())
    column = predictor.rotations.index("I_MCP")
    sensor = LAYOUT.sensors.index("I_MCP")
    readings = np.full((5, 18), 128.0)
    readings[:, sensor] = 128.0, 55.0 - 7.2, 55.0 - 7.3, 200.0 + 7.2, 200.0 + 7.3
    flags = predictor.predict(readings).flags & EXTRAPOLATING
    assert flags[:, column].tolist() == [0, 0, 1, 0, 1]
    affected = {"I_MCP", "IM_ABD"}
    for other, name in enumerate(predictor.rotations):
        if name not in affected:
            assert not flags[:, other].any(), name


def test_far_away_is_flagged_uncertain() -> None:
    predictor = GlovePredictor(make_model())
    flags = predictor.predict(np.full((1, 18), 5000.0)).flags
    fused = [i for i, name in enumerate(predictor.rotations) if name not in ("W_ABD", "T_TMC")]
    assert (flags[0, fused] & TOO_UNCERTAIN).all()
    assert (flags & EXTRAPOLATING).all()


@settings(max_examples=30)
@given(st.integers(0, 17), st.sampled_from([np.nan, np.inf, -np.inf]), st.integers(1, 4))
def test_readings_that_are_not_finite_are_refused(sensor: int, value: float, frames: int) -> None:
    readings = np.full((frames, 18), 100.0)
    readings[-1, sensor] = value
    with pytest.raises(BadInput, match=LAYOUT.sensors[sensor]):
        PREDICTOR.predict(readings)


PREDICTOR = GlovePredictor(make_model())


def test_wrong_shapes_are_refused_and_no_frame_is_no_frame() -> None:
    with pytest.raises(BadInput, match=r"\(N, 18\)"):
        PREDICTOR.predict(np.zeros((2, 17)))
    with pytest.raises(BadInput, match=r"\(N, 18\)"):
        PREDICTOR.predict(np.zeros(18))
    empty = PREDICTOR.predict(np.zeros((0, 18)))
    assert empty.mean.shape == empty.sd.shape == empty.flags.shape == (0, len(ROTATIONS))
    assert empty.flags.dtype == np.uint8


def test_rules_in_a_circle_are_refused() -> None:
    model = make_model()
    pip = model.rotations[ROTATIONS.index("I_PIP")]
    circle = RotationModel(
        pip.correspondence,
        RuleRegressor(("T_TMC",), np.array([1.0])),
        pip.input_low,
        pip.input_high,
        4.0,
        None,
        5,
    )
    items = tuple(circle if item is pip else item for item in model.rotations)
    with pytest.raises(BadInput, match="circle"):
        GlovePredictor(CalibrationModel(LAYOUT, "anna", "lmc_gpr", items, ()))


def test_an_unusable_correction_is_left_out_and_flagged_through_the_rules() -> None:
    predictor = GlovePredictor(make_model())
    angles = predictor.predict(np.random.default_rng(4).uniform(100, 150, (3, len(LAYOUT.sensors))))
    correction = np.full_like(angles.mean, 2.0)
    source = predictor.rotations.index("I_PIP")
    correction[0, source], correction[1, source] = np.nan, -400.0
    doubtful = np.zeros(correction.shape, dtype=bool)
    doubtful[2, source] = True
    corrected = predictor.corrected(angles, correction, doubtful)
    np.testing.assert_allclose(corrected.mean[:, source] - angles.mean[:, source], [0.0, 0.0, 2.0])
    assert (corrected.flags[:, source] & TOO_UNCERTAIN).all()
    plain = predictor.corrected(angles, np.full_like(angles.mean, 2.0))
    np.testing.assert_array_equal(plain.flags, angles.flags)
    followers = [
        row for row in range(len(predictor.rotations))
        if ((corrected.flags & ~plain.flags)[:, row] & TOO_UNCERTAIN).any() and row != source
    ]  # fmt: skip
    assert followers
    assert all((corrected.flags[:, row] & BY_RULE).all() for row in followers)
