"""Exact processes against differences, GPy and scikit-learn; degenerate samples; cancel."""

import json
import warnings
from typing import Any

import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from glovecal_models.covariance.base import Covariance
from glovecal_models.covariance.functions import (
    LinearArd,
    Polynomial,
    SquaredExponential,
    SquaredExponentialArd,
)
from glovecal_models.errors import Cancelled, NotTrainable
from glovecal_models.regression.exact import ExactLikelihood, fit_exact
from glovecal_models.regression.linear_regressor import LinearMean, Mean, ZeroMean
from glovecal_models.regression.regressor import ProcessRegressor

NINE_MODELS = {
    "m0 RBF": lambda s, r: fit_exact(s, r, ZeroMean(), SquaredExponential()),
    "m0 LARD": lambda s, r: fit_exact(s, r, ZeroMean(), LinearArd()),
    "m0 seARD+seARD": lambda s, r: fit_exact(
        s, r, ZeroMean(), SquaredExponentialArd() + SquaredExponentialArd()
    ),
    "m0 LARD+seARD": lambda s, r: fit_exact(s, r, ZeroMean(), LinearArd() + SquaredExponentialArd()),
    "ml RBF": lambda s, r: fit_exact(s, r, LinearMean(), SquaredExponential()),
    "ml LARD": lambda s, r: fit_exact(s, r, LinearMean(), LinearArd()),
    "ml seARD+seARD": lambda s, r: fit_exact(
        s, r, LinearMean(), SquaredExponentialArd() + SquaredExponentialArd()
    ),
    "ml LARD+seARD": lambda s, r: fit_exact(s, r, LinearMean(), LinearArd() + SquaredExponentialArd()),
    "ml poly3": lambda s, r: fit_exact(s, r, LinearMean(), Polynomial(3)),
}
"""The eight models of Wang & Neff (2013), Table 2, and a polynomial one; ``fit_exact`` takes no more."""


def coupled_joint(count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """An abduction sensor stretched by two flexions, 8-bit readings; inputs, target, truth in degrees."""
    generator = np.random.default_rng(seed)
    flexion = generator.uniform(0, 90, size=(count, 2))
    abduction = generator.uniform(-5, 30, size=count)
    stretched = 90 + 2.2 * abduction + 25 * np.sin(flexion[:, 0] / 50) * (1 + flexion[:, 1] / 120)
    inputs = np.round(np.column_stack([stretched, 40 + 1.9 * flexion])).clip(0, 255)
    return inputs, abduction + generator.normal(scale=0.5, size=count), abduction


def some_likelihood(mean: Mean, covariance: Covariance) -> tuple[ExactLikelihood, np.ndarray]:
    generator = np.random.default_rng(1)
    x = generator.normal(size=(25, 2))
    y = np.sin(2 * x[:, 0]) + x[:, 1] + 0.1 * generator.normal(size=25)
    likelihood = ExactLikelihood(x, y, mean, covariance)
    parameters = generator.normal(scale=0.4, size=len(covariance.parameter_names(2)) + 1) - 0.5
    return likelihood, parameters


def gpy():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import GPy
    return GPy


@pytest.mark.parametrize("mean", [ZeroMean(), LinearMean()])
@pytest.mark.parametrize(
    "covariance",
    [SquaredExponential(), LinearArd() + SquaredExponentialArd(), Polynomial(2)],
    ids=repr,
)
def test_gradient_of_the_likelihood_agrees_with_finite_differences(
    mean: Mean, covariance: Covariance
) -> None:
    likelihood, parameters = some_likelihood(mean, covariance)
    _, gradient = likelihood(parameters)
    for index in range(len(parameters)):
        step = np.zeros(len(parameters))
        step[index] = 1e-5
        numerical = (likelihood(parameters + step)[0] - likelihood(parameters - step)[0]) / 2e-5
        assert gradient[index] == pytest.approx(numerical, rel=1e-6, abs=1e-6)


def test_likelihood_is_gpys_to_ten_digits() -> None:
    """The paper's whole model (LARD + seARD + linear mean), GPy holding our mean as a fixed mapping."""
    GPy = gpy()
    likelihood, parameters = some_likelihood(LinearMean(), LinearArd() + SquaredExponentialArd())
    beta, eta, gamma, noise = np.split(np.exp(parameters), [2, 3, 5])
    lower = likelihood.cholesky(
        likelihood.covariance(parameters[:-1], likelihood.x, likelihood.x), float(noise[0])
    )
    coefficients, _ = likelihood.fit_mean(lower)
    mapping = GPy.mappings.Additive(GPy.mappings.Linear(2, 1), GPy.mappings.Constant(2, 1))
    kernel = GPy.kern.Linear(2, variances=beta, ARD=True) + GPy.kern.RBF(
        2, variance=float(eta[0]), lengthscale=gamma**-0.5, ARD=True
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = GPy.models.GPRegression(
            likelihood.x, likelihood.y[:, None], kernel, mean_function=mapping, noise_var=float(noise[0])
        )
        mapping.mapping1.A[:] = coefficients[:2, None]
        mapping.mapping2.C[:] = coefficients[2]
        theirs = -float(np.squeeze(model.log_likelihood()))
    assert likelihood(parameters)[0] == pytest.approx(theirs, rel=1e-10)


def test_profiled_mean_is_the_best_mean() -> None:
    likelihood, parameters = some_likelihood(LinearMean(), SquaredExponentialArd())
    theta, noise = parameters[:-1], float(np.exp(parameters[-1]))
    lower = likelihood.cholesky(likelihood.covariance(theta, likelihood.x, likelihood.x), noise)
    coefficients, _ = likelihood.fit_mean(lower)
    for change in np.eye(3) * 0.01:
        for moved in (coefficients + change, coefficients - change):
            residual = likelihood.y - LinearMean().basis(likelihood.x) @ moved
            fixed = ExactLikelihood(likelihood.x, residual, ZeroMean(), likelihood.covariance)
            assert fixed(parameters)[0] > likelihood(parameters)[0]


def test_prediction_is_scikit_learns_to_six_digits() -> None:
    """Same hyperparameters given to both; the target centred by both."""
    inputs, target, _ = coupled_joint(150)
    regressor = fit_exact(inputs, target, ZeroMean(), SquaredExponentialArd())
    x = (inputs - regressor.input_shift) / regressor.input_scale
    eta, *gamma = np.exp(regressor.theta)
    lengthscales: Any = np.array(gamma) ** -0.5
    no_search: Any = None
    kernel = ConstantKernel(eta) * RBF(lengthscales) + WhiteKernel(regressor.noise_variance)
    theirs = GaussianProcessRegressor(kernel, alpha=regressor.jitter, optimizer=no_search)
    theirs.fit(x, target - target.mean())
    new, _, _ = coupled_joint(60, seed=9)
    mean, deviation = map(
        np.asarray, theirs.predict((new - regressor.input_shift) / regressor.input_scale, return_std=True)
    )
    ours = regressor.predict(new)
    assert ours.mean == pytest.approx(mean + target.mean(), rel=1e-6, abs=1e-6)
    assert ours.variance + regressor.noise_variance == pytest.approx(deviation**2, rel=1e-6)


@pytest.mark.parametrize("name", NINE_MODELS)
def test_each_of_table_2_and_a_polynomial_trains_in_one_line(name: str) -> None:
    inputs, target, _ = coupled_joint(120)
    regressor = NINE_MODELS[name](inputs, target)
    new, _, truth = coupled_joint(100, seed=5)
    error = np.sqrt(np.mean((regressor.predict(new).mean - truth) ** 2))
    assert error < (4.0 if name.endswith(" LARD") else 1.0)
    assert (regressor.method == "lmc_gpr") == (name == "ml LARD+seARD")
    again = ProcessRegressor.restore(regressor.arrays(), json.loads(json.dumps(regressor.settings())))
    assert np.array_equal(again.predict(new).mean, regressor.predict(new).mean)


def test_linear_part_of_the_covariance_is_redundant_beside_a_linear_mean() -> None:
    inputs, target, _ = coupled_joint(150)
    without = fit_exact(inputs, target, LinearMean(), SquaredExponentialArd())
    beside = fit_exact(inputs, target, LinearMean(), LinearArd() + SquaredExponentialArd())
    assert beside.evidence["nlml"] == pytest.approx(without.evidence["nlml"], abs=0.01)


def test_likelihood_in_degrees_is_that_of_the_stored_model() -> None:
    inputs, target, _ = coupled_joint(80)
    regressor = fit_exact(inputs, target, LinearMean(), SquaredExponentialArd())
    gram = regressor.covariance(regressor.theta, regressor.nodes, regressor.nodes)
    gram += (regressor.noise_variance + regressor.jitter) * np.eye(80)
    residual = target - regressor.nodes @ regressor.slope - regressor.intercept
    _, log_determinant = np.linalg.slogdet(gram)
    dense = 0.5 * (residual @ np.linalg.solve(gram, residual) + log_determinant + 80 * np.log(2 * np.pi))
    in_degrees = regressor.evidence["nlml"] + 80 * np.log(regressor.evidence["target_scale_deg"])
    assert in_degrees == pytest.approx(dense, rel=1e-9)


def test_prediction_carries_the_mean_beyond_the_samples() -> None:
    """Far outside, the prediction goes on along the plane instead of falling back to the average."""
    generator = np.random.default_rng(2)
    inputs = generator.uniform(100, 150, size=(100, 1))
    target = 0.5 * inputs[:, 0] + np.sin(inputs[:, 0] / 3) + generator.normal(scale=0.05, size=100)
    regressor = fit_exact(inputs, target, LinearMean(), SquaredExponentialArd())
    assert regressor.predict(np.array([[250.0]])).mean[0] == pytest.approx(125, abs=6)


def test_noise_is_found() -> None:
    inputs, target, _ = coupled_joint(400)
    regressor = fit_exact(inputs, target, LinearMean(), SquaredExponentialArd())
    assert np.sqrt(regressor.noise_variance) == pytest.approx(0.6, abs=0.15)  # 0.5 and the rounded readings


def test_duplicate_and_collinear_samples_train() -> None:
    inputs, target, _ = coupled_joint(60)
    inputs = np.column_stack([inputs, inputs[:, 1], 3 * inputs[:, 0] - 7])
    regressor = fit_exact(
        np.repeat(inputs, 3, axis=0), np.repeat(target, 3), LinearMean(), SquaredExponentialArd()
    )
    prediction = regressor.predict(inputs)
    assert np.isfinite(prediction.mean).all()
    assert np.sqrt(np.mean((prediction.mean - target) ** 2)) < 1.5


def test_samples_that_cannot_carry_a_model_are_refused() -> None:
    inputs, target, _ = coupled_joint(50)
    target[3] = np.nan
    with pytest.raises(NotTrainable, match="sample 4"):
        fit_exact(inputs, target, LinearMean(), SquaredExponentialArd())


def test_cancel_stops_and_progress_rises() -> None:
    inputs, target, _ = coupled_joint(50)
    asked = 0

    def cancelled() -> bool:
        nonlocal asked
        asked += 1
        return asked > 5

    with pytest.raises(Cancelled, match="after 5 evaluations"):
        fit_exact(inputs, target, LinearMean(), SquaredExponentialArd(), cancelled=cancelled)
    heard: list[tuple[str, float]] = []
    fit_exact(inputs, target, LinearMean(), SquaredExponentialArd(), report=lambda *a: heard.append(a))
    assert all(0 <= fraction <= 1 for _, fraction in heard)
    assert [fraction for _, fraction in heard] == sorted(fraction for _, fraction in heard)
