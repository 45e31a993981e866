"""Processes with any kernel on merged and weighted samples: against scikit-learn and dense formulas."""

from typing import Any

import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, DotProduct, Kernel, WhiteKernel

from glovecal_models.covariance.base import Covariance
from glovecal_models.covariance.functions import Polynomial, SquaredExponentialArd
from glovecal_models.errors import Cancelled, NotTrainable
from glovecal_models.regression.exact import CountedLikelihood, ExactLikelihood
from glovecal_models.regression.fast_lmc import fit_lmc_gpr
from glovecal_models.regression.kernel_candidates import KernelCandidate
from glovecal_models.regression.linear_regressor import LinearMean, Mean, ZeroMean
from glovecal_models.regression.regressor import ProcessRegressor
from glovecal_models.regression.training_samples import MergedSamples, standardise

POLYNOMIAL = Polynomial(3)
GENERAL = SquaredExponentialArd() + SquaredExponentialArd()


def cubic(count: int = 120, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Two 8-bit sensors and a polynomial of degree 3 of them, degrees, noise 0.7."""
    random = np.random.default_rng(seed)
    share = random.uniform(size=(count, 2))
    angle = 60 * share[:, 0] ** 3 + 40 * share[:, 0] * share[:, 1] - 20 * share[:, 1] ** 2
    return np.round(40 + 180 * share), angle + random.normal(scale=0.7, size=count)


def fit_process(
    inputs: np.ndarray, target: np.ndarray, mean: Mean, covariance: Covariance, method: str, **search: Any
) -> ProcessRegressor:
    return KernelCandidate("tried", "a tried kernel", method, mean, covariance).fit(inputs, target, **search)


def theirs(process: ProcessRegressor) -> GaussianProcessRegressor:
    """scikit-learn's process with the same hyperparameters, untrained: degrees and working inputs."""
    variance, offset = np.exp(process.theta)
    kernel: Kernel = ConstantKernel(variance) * DotProduct(np.sqrt(offset)) ** 3
    kernel = kernel + WhiteKernel(process.noise_variance)
    return GaussianProcessRegressor(kernel, alpha=process.jitter, optimizer=None)  # pyright: ignore[reportArgumentType]


def test_a_polynomials_likelihood_and_prediction_are_scikit_learns() -> None:
    inputs, target = cubic()
    process = fit_process(inputs, target, ZeroMean(), POLYNOMIAL, "polynomial_gpr")
    other = theirs(process)
    other.fit((inputs - process.input_shift) / process.input_scale, target - target.mean())
    nlml = process.evidence["nlml"] + len(target) * np.log(process.evidence["target_scale_deg"])
    assert nlml == pytest.approx(-float(np.asarray(other.log_marginal_likelihood_value_)), rel=1e-8)
    new, _ = cubic(50, seed=1)
    mean, deviation = map(
        np.asarray, other.predict((new - process.input_shift) / process.input_scale, return_std=True)
    )
    found = process.predict(new)
    assert found.mean == pytest.approx(mean + target.mean(), abs=1e-5)
    assert np.sqrt(found.variance + process.noise_variance) == pytest.approx(deviation, abs=1e-5)
    assert len(process.nodes) == 10  # the monomials of degree 0 to 3 in two sensors


@pytest.mark.parametrize("covariance", [POLYNOMIAL, GENERAL], ids=repr)
@pytest.mark.parametrize("weight", [1.0, 0.3])
def test_gradient_agrees_with_finite_differences(covariance: Covariance, weight: float) -> None:
    inputs, target = cubic(40)
    working = standardise(np.round(inputs, -1), target)  # coarse: many inputs are equal
    likelihood = CountedLikelihood(MergedSamples.of(working.x, working.y, weight), LinearMean(), covariance)
    at = np.append(covariance.initial(working.x, working.y) - 0.3, np.log(0.1))
    _, gradient = likelihood(at)
    for index in range(len(at)):
        step = 1e-5 * np.eye(len(at))[index]
        numerical = (likelihood(at + step)[0] - likelihood(at - step)[0]) / 2e-5
        assert gradient[index] == pytest.approx(numerical, rel=1e-5, abs=1e-5)


def test_merged_samples_have_the_likelihood_of_all_of_them() -> None:
    inputs, target = cubic(60)
    working = standardise(np.round(inputs, -1), target)
    samples = MergedSamples.of(working.x, working.y)
    assert len(samples.inputs) < 60
    at = np.append(POLYNOMIAL.initial(working.x, working.y), np.log(0.1))
    merged = CountedLikelihood(samples, LinearMean(), POLYNOMIAL, jitter=0.0)(at)
    apart = ExactLikelihood(working.x, working.y, LinearMean(), POLYNOMIAL, jitter=0.0)(at)
    assert merged[0] == pytest.approx(apart[0], rel=1e-9)
    assert merged[1] == pytest.approx(apart[1], rel=1e-6)


@pytest.mark.parametrize("weight", [1.0, 0.25])
def test_likelihoods_stand_beside_those_of_lmc_gpr(weight: float) -> None:
    """At LMC-GPR's own hyperparameters: the same samples, weight and units."""
    inputs, target = cubic(150)
    lmc = fit_lmc_gpr(inputs, target, sample_weight=weight)
    working = standardise(inputs, target)
    likelihood = CountedLikelihood(
        MergedSamples.of(working.x, working.y, weight), LinearMean(), SquaredExponentialArd(), jitter=0.0
    )
    variance = working.target_scale**2
    at = np.append(
        SquaredExponentialArd().scaled(lmc.theta, 1 / variance), np.log(lmc.noise_variance / variance)
    )
    assert likelihood(at)[0] == pytest.approx(lmc.evidence["nlml"], abs=1e-3)


def test_few_nodes_predict_what_all_samples_do() -> None:
    inputs, target = cubic(200)
    process = fit_process(inputs, target, ZeroMean(), GENERAL, "general_gpr")
    assert len(process.nodes) < 100
    working = standardise(inputs, target)
    likelihood = CountedLikelihood(MergedSamples.of(working.x, working.y), ZeroMean(), GENERAL)
    exact = likelihood.posterior(np.array(process.evidence["parameters"]))
    new, _ = cubic(60, seed=2)
    x, theta = (
        (new - process.input_shift) / process.input_scale,
        np.array(process.evidence["parameters"])[:-1],
    )
    to_samples = GENERAL(theta, x, likelihood.samples.inputs)
    mean = working.target_shift + working.target_scale * (to_samples @ exact.weights)
    explained = np.linalg.solve(exact.lower, to_samples.T)
    deviation = working.target_scale * np.sqrt(GENERAL.diagonal(theta, x) - (explained**2).sum(axis=0))
    found = process.predict(new)
    assert found.mean == pytest.approx(mean, abs=5e-3)
    assert np.sqrt(found.variance) == pytest.approx(deviation, abs=1e-2)


def test_a_start_replaces_the_search_and_the_same_samples_give_the_same_process() -> None:
    inputs, target = cubic()
    first = fit_process(inputs, target, LinearMean(), POLYNOMIAL, "polynomial_gpr")
    again = fit_process(inputs, target, LinearMean(), POLYNOMIAL, "polynomial_gpr")
    assert first.evidence == again.evidence
    near = fit_process(
        inputs, target, LinearMean(), POLYNOMIAL, "polynomial_gpr", start=first.evidence["parameters"]
    )
    assert near.evidence["evaluations"] < 10
    assert near.evidence["nlml"] == pytest.approx(first.evidence["nlml"], abs=0.01)


def test_refused_and_cancelled() -> None:
    inputs, target = cubic()
    with pytest.raises(NotTrainable, match="3 samples are too few"):
        fit_process(inputs[:3], target[:3], ZeroMean(), POLYNOMIAL, "polynomial_gpr")
    with pytest.raises(Cancelled):
        fit_process(inputs, target, ZeroMean(), POLYNOMIAL, "polynomial_gpr", cancelled=lambda: True)
    with pytest.raises(NotTrainable, match=r"Polynomial\(3\) has no likelihood on these 120 samples"):
        fit_process(inputs, target, ZeroMean(), POLYNOMIAL, "polynomial_gpr", start=[np.nan] * 3)
