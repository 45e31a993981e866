"""fit_lmc_gpr: the optimum other libraries find, the exact process served on few nodes, and wild inputs."""

import json
import warnings
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel

from glovecal_models.errors import Cancelled, NotTrainable
from glovecal_models.regression.fast_lmc import fit_lmc_gpr
from glovecal_models.regression.regressor import ProcessRegressor


def make_joint(count: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """An abduction sensor stretched by two flexions, 8 bits, 1 degree noise: inputs, target, truth."""
    generator = np.random.default_rng(seed)
    truth = generator.uniform(-20, 20, count)
    flexion = generator.uniform(0, 90, (count, 2))
    stretch = 25 * np.tanh((flexion[:, 0] - flexion[:, 1]) / 60) + 0.01 * flexion[:, 0] * truth
    inputs = np.round(np.column_stack([128 + 3 * truth + stretch, 40 + 2 * flexion]))
    return inputs, truth + generator.standard_normal(count), truth


def scikit_learn_process(fitted: ProcessRegressor, x: np.ndarray, target: np.ndarray):
    """An exact process at our hyperparameters, with our plane taken off first; x in working units."""
    lengthscales: Any = np.exp(-0.5 * fitted.theta[1:])
    fixed: Any = None
    kernel = ConstantKernel(np.exp(fitted.theta[0])) * RBF(lengthscales)
    process = GaussianProcessRegressor(kernel, alpha=fitted.noise_variance, optimizer=fixed)
    return process.fit(x, target - x @ fitted.slope - fitted.intercept)


def exact_prediction(fitted: ProcessRegressor, inputs, target, at):
    """Mean and standard deviation by scikit-learn at raw inputs ``at``."""
    x, z = ((a - fitted.input_shift) / fitted.input_scale for a in (inputs, at))
    process = scikit_learn_process(fitted, x, target)
    mean, sd = process.predict(z, return_std=True)
    return mean + z @ fitted.slope + fitted.intercept, sd


def test_optimum_is_gpys_or_better() -> None:
    inputs, target, _ = make_joint(300)
    fitted = fit_lmc_gpr(inputs, target)
    x = (inputs - inputs.mean(axis=0)) / inputs.std(axis=0)
    y = (target - target.mean()) / target.std()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import GPy  # here, because every process of the suite would wait seconds for it

        mean = GPy.mappings.Additive(GPy.mappings.Linear(3, 1), GPy.mappings.Constant(3, 1))
        model = GPy.models.GPRegression(x, y[:, None], GPy.kern.RBF(3, ARD=True), mean_function=mean)
        model.optimize(max_iters=300)
    assert fitted.evidence["nlml"] <= float(model.objective_function()) + 1e-3
    if abs(fitted.evidence["nlml"] - float(model.objective_function())) < 1e-2:
        np.testing.assert_allclose(
            np.exp(-0.5 * fitted.theta[1:]), np.array(model.kern.lengthscale), rtol=0.05
        )


@pytest.mark.parametrize("count", [200, 900])
def test_served_nodes_predict_the_exact_process(count: int) -> None:
    inputs, target, _ = make_joint(count)
    fitted = fit_lmc_gpr(inputs, target)
    at, _, later = make_joint(300, seed=9)
    mean, sd = exact_prediction(fitted, inputs, target, np.vstack([inputs, at]))
    served = fitted.predict(np.vstack([inputs, at]))
    assert len(fitted.nodes) < 130
    assert fitted.evidence["served_mean_error_deg"] <= 5e-4
    np.testing.assert_allclose(served.mean[:count], mean[:count], atol=1e-3)
    np.testing.assert_allclose(np.sqrt(served.variance[:count]), sd[:count], atol=2e-3)
    np.testing.assert_allclose(served.mean[count:], mean[count:], atol=5e-3)
    np.testing.assert_allclose(np.sqrt(served.variance[count:]), sd[count:], atol=1e-2)
    assert np.sqrt(np.mean((served.mean[count:] - later) ** 2)) < 0.6
    assert 0.85 < np.sqrt(fitted.noise_variance) < 1.15


def test_certificate_holds_the_exact_likelihood_of_scikit_learn() -> None:
    inputs, target, _ = make_joint(900)
    fitted = fit_lmc_gpr(inputs, target)
    evidence = fitted.evidence
    assert evidence["certificate"] == "trace bounds"
    assert 0 <= evidence["nlml_upper"] - evidence["nlml_lower"] < 0.05
    x = (inputs - fitted.input_shift) / fitted.input_scale
    process = scikit_learn_process(fitted, x, target)
    in_degrees = -float(np.asarray(process.log_marginal_likelihood_value_))
    standardised = in_degrees - len(target) * np.log(evidence["target_scale_deg"])
    assert evidence["nlml_lower"] - 1e-4 <= standardised <= evidence["nlml_upper"] + 1e-4


def test_same_seed_same_model() -> None:
    inputs, target, _ = make_joint(400)
    one, other = fit_lmc_gpr(inputs, target), fit_lmc_gpr(inputs, target)
    assert one.settings() == other.settings()
    for name, array in one.arrays().items():
        np.testing.assert_array_equal(array, other.arrays()[name])


def test_survives_storage() -> None:
    inputs, target, _ = make_joint(200)
    fitted = fit_lmc_gpr(inputs, target)
    again = ProcessRegressor.restore(fitted.arrays(), json.loads(json.dumps(fitted.settings())))
    np.testing.assert_array_equal(again.predict(inputs).mean, fitted.predict(inputs).mean)


def test_units_do_not_matter() -> None:
    inputs, target, _ = make_joint(300)
    fitted = fit_lmc_gpr(inputs, target)
    volts = fit_lmc_gpr(inputs / 51.0 + 2.0, target * 0.1)
    np.testing.assert_allclose(
        volts.predict(inputs / 51.0 + 2.0).mean * 10.0, fitted.predict(inputs).mean, atol=1e-2
    )


def test_a_missing_input_is_suspected_and_not_otherwise() -> None:
    """An unmeasured joint that moves slowly: the process can follow it only by memorising the path."""
    generator = np.random.default_rng(4)
    time = np.arange(700) / 30.0
    bend, hidden = (sum(np.sin(w * time + p) for w, p in waves) for waves in WAVES)
    inputs = np.column_stack([128 + 30 * bend, 128 + 25 * np.cos(0.7 * time) + 10 * bend])
    inputs = np.round(inputs + 0.5 * generator.standard_normal(inputs.shape))
    noise = 0.3 * generator.standard_normal(700)
    assert fit_lmc_gpr(inputs, 20 * bend + 8 * hidden + noise).evidence["missing_input_suspected"]
    assert not fit_lmc_gpr(inputs, 20 * bend + 2 * bend**2 + noise).evidence["missing_input_suspected"]


WAVES = (((1.1, 0.0), (0.43, 1.0)), ((0.9, 2.0), (0.31, 0.5)))


def test_where_nodes_do_not_suffice_the_mean_is_still_exact() -> None:
    generator = np.random.default_rng(2)
    inputs = generator.uniform(0, 255, (700, 3))
    target = 20 * np.sin(inputs[:, 0] / 9) * np.cos(inputs[:, 1] / 8) + 0.3 * generator.standard_normal(700)
    fitted = fit_lmc_gpr(inputs, target)
    assert fitted.evidence["exact_evaluation"]
    mean, _ = exact_prediction(fitted, inputs, target, inputs)
    np.testing.assert_allclose(fitted.predict(inputs).mean, mean, atol=1e-3)


@settings(max_examples=30)
@given(
    count=st.integers(40, 90),
    dimensions=st.integers(1, 10),
    levels=st.sampled_from([1, 3, 30, 255]),
    collinear=st.booleans(),
    noise=st.sampled_from([0.0, 1e-6, 1.0, 50.0]),
    shape=st.sampled_from(["plane", "wave", "step", "nothing"]),
    seed=st.integers(0, 10**6),
)
def test_wild_samples_train_and_predict_finite_angles(
    count: int, dimensions: int, levels: int, collinear: bool, noise: float, shape: str, seed: int
) -> None:
    generator = np.random.default_rng(seed)
    inputs = generator.integers(0, levels + 1, (count, dimensions)) * (255.0 / levels)
    inputs[0], inputs[1] = 0.0, 255.0
    if collinear:
        inputs[:, -1] = 2.0 * inputs[:, 0] + 1.0
    first = inputs[:, 0] / 255.0
    target = {
        "plane": 90 * first,
        "wave": 30 * np.sin(9 * first),
        "step": np.where(first > 0.5, 40.0, -40.0),
        "nothing": np.zeros(count),
    }[shape] + max(noise, 1e-6 if shape == "nothing" else 0.0) * generator.standard_normal(count)
    fitted = fit_lmc_gpr(inputs, target)
    served = fitted.predict(inputs)
    assert np.isfinite(served.mean).all()
    assert (served.variance >= 0).all()
    assert np.sqrt(np.mean((served.mean - target) ** 2)) <= 1.02 * target.std() + 1e-6
    assert np.isfinite([value for name, value in fitted.evidence.items() if name.startswith("nlml")]).all()


def test_one_sensor_of_120_values() -> None:
    generator = np.random.default_rng(3)
    inputs = np.round(generator.uniform(60, 180, (4000, 1)))
    target = 0.5 * inputs[:, 0] + 6 * np.sin(inputs[:, 0] / 25) + generator.standard_normal(4000)
    fitted = fit_lmc_gpr(inputs, target)
    assert fitted.evidence["distinct_inputs"] <= 121
    assert len(fitted.nodes) <= 20
    truth = 0.5 * inputs[:, 0] + 6 * np.sin(inputs[:, 0] / 25)
    assert np.sqrt(np.mean((fitted.predict(inputs).mean - truth) ** 2)) < 0.15


def test_cancel_and_report() -> None:
    inputs, target, _ = make_joint(300)
    with pytest.raises(Cancelled):
        fit_lmc_gpr(inputs, target, cancelled=lambda: True)
    told: list[float] = []
    fit_lmc_gpr(inputs, target, report=lambda sentence, fraction: told.append(fraction))
    assert told == sorted(told)
    assert told[-1] == 1.0


def test_refuses_what_cannot_be_trained() -> None:
    inputs, target, _ = make_joint(100)
    with pytest.raises(NotTrainable, match="move the joint"):
        fit_lmc_gpr(np.column_stack([inputs[:, 0], np.full(100, 7.0)]), target)
    broken = target.copy()
    broken[3] = np.nan
    with pytest.raises(NotTrainable):
        fit_lmc_gpr(inputs, broken)
