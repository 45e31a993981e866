"""Samples of different, stated variance: laws, and other people's implementations."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from glovecal_models.calibration.sample_weight import (
    Recorded,
    fit_linear_with_variance,
    fit_weighted,
    sample_noise,
    with_stated_variance,
)
from glovecal_models.errors import NotTrainable
from glovecal_models.regression.fast_lmc import fit_lmc_gpr
from glovecal_models.regression.linear_regressor import fit_linear
from glovecal_models.regression.profiled_likelihood import ExactProfiledLikelihood
from glovecal_models.regression.regressor import ProcessRegressor
from glovecal_models.regression.training_samples import MergedSamples


def samples(count: int = 160, dimensions: int = 2, seed: int = 0, own_deg: float = 1.0):
    """Inputs, a smooth angle, and errors as large as stated: 0.5 to 6 degrees beside the glove's own."""
    random = np.random.default_rng(seed)
    inputs = np.round(random.uniform(60, 180, (count, dimensions)))
    angle = 40 * np.tanh((inputs[:, 0] - 120) / 40) + 0.1 * inputs.sum(axis=1)
    sd = random.uniform(0.5, 6.0, count)
    error = np.sqrt(sd**2 + own_deg**2) * random.standard_normal(count)
    return inputs, angle, angle + error, sd**2


def both(inputs, target, variance) -> tuple[ProcessRegressor, ProcessRegressor]:
    alike = fit_lmc_gpr(inputs, target)
    return alike, with_stated_variance(alike, inputs, target, variance)


@settings(max_examples=12)
@given(st.integers(0, 10_000), st.floats(0.0, 30.0))
def test_equal_variances_change_nothing(seed, variance):
    inputs, _, target, _ = samples(60, 2, seed)
    equal = np.full(len(target), variance)
    alike, found = both(inputs, target, equal)
    np.testing.assert_allclose(found.predict(inputs).mean, alike.predict(inputs).mean, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.predict(inputs).variance, alike.predict(inputs).variance, atol=1e-9)
    line, weighted = fit_linear(inputs, target), fit_linear_with_variance(inputs, target, equal)
    np.testing.assert_allclose(weighted.predict(inputs).mean, line.predict(inputs).mean, rtol=0, atol=1e-9)
    assert weighted.noise_variance == pytest.approx(line.noise_variance, abs=1e-9)


def test_equal_variances_train_the_same_process_by_its_samples():
    inputs, _, target, _ = samples(90, 1)
    owner, place = np.repeat(np.arange(3), 30), np.arange(90)
    plain = fit_weighted(Recorded(inputs, target, owner, place))
    equal = fit_weighted(Recorded(inputs, target, owner, place, np.full(90, 4.0)))
    np.testing.assert_allclose(equal.regressor.mean(inputs), plain.regressor.mean(inputs), rtol=0, atol=1e-9)


def test_the_process_is_scikit_learns_with_a_variance_for_each_sample():
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel

    inputs, _, target, variance = samples()
    alike, found = both(inputs, target, variance)
    noise = sample_noise(variance, alike.predict(inputs).mean - target)
    assert noise is not None
    each = found.noise_variance * (noise.own_variance + variance) / noise.own_variance
    x = (inputs - found.input_shift) / found.input_scale
    signal, lengthscales = np.exp(found.theta[0]), np.exp(-0.5 * found.theta[1:])
    choices: dict[str, Any] = {"alpha": each, "optimizer": None}
    of_lengthscales: dict[str, Any] = {"length_scale": lengthscales, "length_scale_bounds": "fixed"}
    other = GaussianProcessRegressor(ConstantKernel(signal, "fixed") * RBF(**of_lengthscales), **choices)
    other.fit(x, target - x @ found.slope - found.intercept)
    at = np.random.default_rng(1).uniform(60, 180, (50, 2))
    z = (at - found.input_shift) / found.input_scale
    mean, sd = other.predict(z, return_std=True)
    mine = found.predict(at)
    np.testing.assert_allclose(mine.mean, mean + z @ found.slope + found.intercept, atol=2e-3)
    np.testing.assert_allclose(np.sqrt(mine.variance), sd, atol=5e-3)


def test_the_process_is_gpys_with_a_variance_for_each_sample():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        gpy = pytest.importorskip("GPy")
        inputs, _, target, variance = samples(80, 1)
        alike, found = both(inputs, target, variance)
        noise = sample_noise(variance, alike.predict(inputs).mean - target)
        assert noise is not None
        each = found.noise_variance * (noise.own_variance + variance) / noise.own_variance
        x = (inputs - found.input_shift) / found.input_scale
        kernel = gpy.kern.RBF(1, variance=np.exp(found.theta[0]), lengthscale=np.exp(-0.5 * found.theta[1]))
        residual = (target - x @ found.slope - found.intercept)[:, None]
        other = gpy.models.GPHeteroscedasticRegression(x, residual, kernel)
        other.het_Gauss.variance[:] = each[:, None]
        mean, spread = other._raw_predict(x)
    np.testing.assert_allclose(
        found.predict(inputs).mean, mean[:, 0] + x @ found.slope + found.intercept, atol=2e-3
    )
    np.testing.assert_allclose(found.predict(inputs).variance, spread[:, 0], atol=5e-3)


@pytest.mark.parametrize("repeated", [False, True])
def test_the_likelihood_is_that_of_a_normal_distribution_with_these_variances(repeated):
    random = np.random.default_rng(3)
    x = random.standard_normal((40, 1))
    if repeated:
        x[20:] = x[:20]
    y = np.sin(x[:, 0]) + 0.3 * random.standard_normal(40)
    precision = np.exp(random.standard_normal(40))
    precision /= np.exp(np.log(precision).mean())
    merged = MergedSamples.of(x, y, precision=precision)
    parameters = np.array([np.log(0.7), np.log(0.2)])
    evaluated = ExactProfiledLikelihood(merged).evaluate(parameters)
    assert evaluated is not None
    best = evaluated.profile
    plane = merged.to_plane @ best.plane
    kernel = np.exp(-0.5 * ((x - x.T) / 0.7) ** 2)
    covariance: Any = best.scale * (kernel + 0.2 * np.diag(1 / precision))
    mean = x @ plane[:-1] + plane[-1]
    assert best.nlml == pytest.approx(-multivariate_normal(mean, covariance).logpdf(y), abs=1e-8)


def test_the_line_is_statisticians_weighted_least_squares():
    inputs, _, target, variance = samples(120, 2)
    found = fit_linear_with_variance(inputs, target, variance)
    noise = sample_noise(variance, fit_linear(inputs, target).predict(inputs).mean - target)
    assert noise is not None
    weights = 1.0 / (noise.own_variance + variance)
    design = np.column_stack([inputs, np.ones(len(target))])
    normal = design.T @ (weights[:, None] * design)
    coefficients = np.linalg.solve(normal, design.T @ (weights * target))
    np.testing.assert_allclose(found.predict(inputs).mean, design @ coefficients, atol=1e-7)
    left = target - design @ coefficients
    scale = np.sum(weights * left**2) / (len(target) - 3)
    assert found.noise_variance == pytest.approx(scale * noise.own_variance, rel=1e-9)
    each = np.einsum("nd,de,ne->n", design, np.linalg.inv(normal) * scale, design)
    np.testing.assert_allclose(found.predict(inputs).variance, each, rtol=1e-3)


def test_stated_variances_are_nearer_to_the_truth_and_tell_the_gloves_own_noise():
    better, own, times = [], [], []
    for seed in range(6):
        inputs, angle, target, variance = samples(200, 1, seed)
        alike, found = both(inputs, target, variance)
        errors = [np.sqrt(np.mean((item.mean(inputs) - angle) ** 2)) for item in (alike, found)]
        better.append(errors[1] / errors[0])
        own.append(found.evidence["own_noise_deg"])
        times.append(found.evidence["stated_variance_times"])
    assert np.mean(better) < 0.9
    assert 0.5 < np.median(own) < 2.5
    assert np.median(times) == pytest.approx(1.0, abs=0.35)


def test_a_sample_of_no_use_counts_for_nothing():
    inputs, angle, target, variance = samples(120, 1)
    spoiled, useless = target.copy(), variance.copy()
    spoiled[:20] += 60.0
    useless[:20] = 3000.0
    found = with_stated_variance(fit_lmc_gpr(inputs, spoiled), inputs, spoiled, useless)
    assert np.sqrt(np.mean((found.mean(inputs) - angle) ** 2)) < 3.0


@pytest.mark.parametrize("wrong", [np.ones(3), np.full(60, -1.0), np.full(60, np.nan)])
def test_variances_that_cannot_be_are_refused(wrong):
    inputs, _, target, _ = samples(60, 1)
    with pytest.raises(NotTrainable, match="variances of the reference"):
        fit_linear_with_variance(inputs, target, wrong)
