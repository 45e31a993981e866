"""Samples that count for less than one: two that count a half each are one, in every likelihood."""

import numpy as np
import pytest

from glovecal_models.covariance.functions import SquaredExponentialArd
from glovecal_models.regression.fast_lmc import fit_lmc_gpr
from glovecal_models.regression.fitc import FitcLikelihood
from glovecal_models.regression.linear_regressor import LinearMean
from glovecal_models.regression.profiled_likelihood import ExactProfiledLikelihood, LowRankLikelihood
from glovecal_models.regression.spgp import fit_spgp
from glovecal_models.regression.training_samples import MergedSamples


def made_up(count: int, seed: int = 4) -> tuple[np.ndarray, np.ndarray]:
    generator = np.random.default_rng(seed)
    x = generator.normal(size=(count, 2))
    return x, np.sin(2 * x[:, 0]) + 0.4 * x[:, 1] + 0.2 * generator.normal(size=count)


def fitc(x: np.ndarray, y: np.ndarray, weight: float) -> FitcLikelihood:
    return FitcLikelihood(x, y, LinearMean(), SquaredExponentialArd(), sample_weight=weight)


PARAMETERS = np.array([0.1, 0.4, -0.2, np.log(0.05)])


def test_two_halves_are_one_to_the_sparse_likelihood() -> None:
    x, y = made_up(60)
    z = x[:9].ravel()
    whole = fitc(x, y, 1.0)(np.append(PARAMETERS, z))
    halves = fitc(np.repeat(x, 2, axis=0), np.repeat(y, 2), 0.5)(np.append(PARAMETERS, z))
    assert halves[0] == pytest.approx(whole[0], rel=1e-11)
    np.testing.assert_allclose(halves[1], whole[1], rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("weight", [0.5, 0.07])
def test_sparse_derivatives_agree_with_finite_differences(weight: float) -> None:
    x, y = made_up(50)
    likelihood = fitc(x, y, weight)
    parameters = np.append(PARAMETERS, x[:6].ravel() + 0.1)
    _, gradient = likelihood(parameters)
    steps = 1e-5 * np.eye(len(parameters))
    numeric = [(likelihood(parameters + step)[0] - likelihood(parameters - step)[0]) / 2e-5 for step in steps]
    np.testing.assert_allclose(gradient, numeric, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("kind", ["exact", "low rank"])
def test_likelihood_of_weighted_samples_is_that_of_dense_matrices(kind: str) -> None:
    """Against the definition: Gaussians to the power w, plane and scale at their best."""
    x, y = made_up(80)
    weight, parameters = 0.3, np.array([0.1, 0.4, np.log(0.05)])
    samples = MergedSamples.of(x, y, weight)
    likelihood = (
        ExactProfiledLikelihood(samples)
        if kind == "exact"
        else LowRankLikelihood.at(samples, np.exp(parameters[:-1]) * 0.8, 1e-10, 80)
    )
    assert likelihood is not None
    evaluated = likelihood.evaluate(parameters)
    assert evaluated is not None
    points = x / np.exp(parameters[:-1])
    kernel = np.exp(-0.5 * ((points[:, None] - points[None]) ** 2).sum(axis=-1))
    rho = float(np.exp(parameters[-1]))
    covariance = kernel + rho / weight * np.eye(80)
    design = np.column_stack([x, np.ones(80)])
    solved = np.linalg.solve(covariance, np.column_stack([design, y]))
    plane = np.linalg.solve(design.T @ solved[:, :3], design.T @ solved[:, 3])
    quadratic = (y - design @ plane) @ (solved[:, 3] - solved[:, :3] @ plane)
    scale = quadratic / (weight * 80)
    nlml = 0.5 * (quadratic / scale + np.linalg.slogdet(scale * covariance)[1] + 80 * np.log(2 * np.pi))
    nlml -= 0.5 * 80 * ((1 - weight) * np.log(2 * np.pi * scale * rho) - np.log(weight))
    assert evaluated.nlml == pytest.approx(nlml, abs=1e-5 if kind == "low rank" else 1e-8)


@pytest.mark.parametrize("kind", ["exact", "low rank"])
def test_derivatives_of_weighted_samples_agree_with_finite_differences(kind: str) -> None:
    x, y = made_up(90)
    parameters = np.array([0.1, 0.4, np.log(0.05)])
    samples = MergedSamples.of(x, y, 0.2)
    likelihood = (
        ExactProfiledLikelihood(samples)
        if kind == "exact"
        else LowRankLikelihood.at(samples, np.exp(parameters[:-1]) * 0.8, 1e-9, 90)
    )
    assert likelihood is not None

    def value(at: np.ndarray) -> float:
        evaluated = likelihood.evaluate(at)
        assert evaluated is not None
        return evaluated.nlml

    evaluated = likelihood.evaluate(parameters)
    assert evaluated is not None
    numeric = [(value(parameters + step) - value(parameters - step)) / 2e-5 for step in 1e-5 * np.eye(3)]
    np.testing.assert_allclose(evaluated.derivatives()[0], numeric, rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize("count", [150, 600])
def test_two_halves_train_the_process_that_one_trains(count: int) -> None:
    x, y = made_up(count)
    whole = fit_lmc_gpr(x, 10 * y)
    halves = fit_lmc_gpr(np.repeat(x, 2, axis=0), np.repeat(10 * y, 2), sample_weight=0.5)
    at = np.random.default_rng(0).normal(size=(50, 2))
    np.testing.assert_allclose(halves.predict(at).mean, whole.predict(at).mean, atol=0.02)
    np.testing.assert_allclose(halves.predict(at).variance, whole.predict(at).variance, atol=0.05, rtol=0.02)
    assert halves.noise_variance == pytest.approx(whole.noise_variance, rel=0.01)
    assert halves.evidence["samples"] == 2 * count
    assert halves.evidence["sample_weight"] == 0.5


def test_samples_that_count_less_are_believed_less() -> None:
    x, y = made_up(300)
    at = x[:50]
    for fit in (fit_lmc_gpr, fit_spgp):
        whole, less = fit(x, 10 * y), fit(x, 10 * y, sample_weight=0.1)
        assert less.predict(at).variance.mean() > 3 * whole.predict(at).variance.mean()
        assert np.sqrt(less.noise_variance) == pytest.approx(2.0, rel=0.3)
