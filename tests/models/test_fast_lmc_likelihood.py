"""The profiled likelihoods behind fast training: against a dense reference, finite differences, bounds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import cho_factor, cho_solve

from glovecal_models.regression.factorisation import pivoted_cholesky
from glovecal_models.regression.profiled_likelihood import (
    ExactProfiledLikelihood,
    LowRankLikelihood,
    NystromFit,
    certify,
)
from glovecal_models.regression.training_samples import MergedSamples


def make_samples(count: int, dimensions: int, seed: int, levels: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Coarse sensors, so that inputs repeat; standardised."""
    generator = np.random.default_rng(seed)
    x = np.round(generator.uniform(-2, 2, (count, dimensions)) * levels / 4) * 4 / levels
    y = np.sin(2 * x[:, 0]) + 0.5 * x[:, -1] + 0.2 * generator.standard_normal(count)
    return (x - x.mean(axis=0)) / x.std(axis=0), (y - y.mean()) / y.std()


def dense_nlml(x: np.ndarray, y: np.ndarray, parameters: np.ndarray) -> float:
    """Every sample its own row, plane by generalised least squares, scale at its best."""
    z = x / np.exp(parameters[:-1])
    covariance = np.exp(-0.5 * ((z[:, None] - z[None]) ** 2).sum(axis=-1))
    covariance += np.exp(parameters[-1]) * np.eye(len(y))
    factor = cho_factor(covariance, lower=True)
    design = np.column_stack([x, np.ones(len(x))])
    weighted = cho_solve(factor, design)
    residual = y - design @ np.linalg.lstsq(design.T @ weighted, weighted.T @ y, rcond=None)[0]
    scale = residual @ cho_solve(factor, residual) / len(y)
    determinant = 2 * np.log(np.diag(factor[0])).sum()
    return 0.5 * (len(y) * (np.log(2 * np.pi * scale) + 1) + determinant)


@pytest.mark.parametrize(("count", "dimensions"), [(150, 1), (120, 2), (200, 3)])
def test_exact_value_is_the_dense_likelihood_of_unmerged_samples(count: int, dimensions: int) -> None:
    x, y = make_samples(count, dimensions, 3, levels=6)
    samples = MergedSamples.of(x, y)
    assert len(samples.inputs) < count
    parameters = np.append(np.linspace(-0.3, 0.5, dimensions), np.log(0.05))
    evaluated = ExactProfiledLikelihood(samples).evaluate(parameters)
    assert evaluated is not None
    assert evaluated.nlml == pytest.approx(dense_nlml(x, y, parameters), abs=1e-8)


@pytest.mark.parametrize("kind", ["exact", "low rank"])
@pytest.mark.parametrize("dimensions", [1, 3])
def test_gradient_matches_central_differences(kind: str, dimensions: int) -> None:
    x, y = make_samples(130, dimensions, 5)
    samples = MergedSamples.of(x, y)
    parameters = np.append(np.linspace(0.2, 0.6, dimensions), np.log(0.03))
    likelihood = (
        ExactProfiledLikelihood(samples)
        if kind == "exact"
        else LowRankLikelihood.at(samples, np.exp(parameters[:-1]) * 0.8, 1e-9, 130)
    )
    assert likelihood is not None

    def value(at: np.ndarray) -> float:
        evaluated = likelihood.evaluate(at)
        assert evaluated is not None
        return evaluated.nlml

    evaluated = likelihood.evaluate(parameters)
    assert evaluated is not None
    gradient, information = evaluated.derivatives()
    steps = 1e-5 * np.eye(dimensions + 1)
    numeric = [(value(parameters + step) - value(parameters - step)) / 2e-5 for step in steps]
    np.testing.assert_allclose(gradient, numeric, rtol=1e-5, atol=1e-4)
    assert np.linalg.eigvalsh(information).min() > -1e-8


def test_average_information_approaches_the_hessian_for_data_of_the_model() -> None:
    """Gilmour, Thompson & Cullis 1995: mean of observed and expected information, equal in expectation."""
    generator = np.random.default_rng(0)
    x = generator.uniform(-1.7, 1.7, (600, 1))
    true = np.array([np.log(0.25), np.log(0.1)])
    covariance = np.exp(-0.5 * ((x - x.T) / np.exp(true[0])) ** 2) + np.exp(true[1]) * np.eye(600)
    y = np.linalg.cholesky(covariance) @ generator.standard_normal(600)
    likelihood = ExactProfiledLikelihood(MergedSamples.of(x, y))

    def gradient(at: np.ndarray) -> np.ndarray:
        evaluated = likelihood.evaluate(at)
        assert evaluated is not None
        return evaluated.derivatives()[0]

    evaluated = likelihood.evaluate(true)
    assert evaluated is not None
    information = evaluated.derivatives()[1]
    hessian = np.array([(gradient(true + s) - gradient(true - s)) / 2e-4 for s in 1e-4 * np.eye(2)])
    np.testing.assert_allclose(np.diag(information), np.diag(hessian), rtol=0.4)


def test_low_rank_value_is_the_exact_one_with_few_nodes() -> None:
    x, y = make_samples(800, 2, 7, levels=200)
    samples = MergedSamples.of(x, y)
    parameters = np.array([0.3, 0.6, np.log(0.05)])
    low_rank = LowRankLikelihood.at(samples, 0.8 * np.exp(parameters[:-1]), 1e-8, 400)
    assert low_rank is not None
    assert low_rank.rank < 100
    approximate, exact = (
        likelihood.evaluate(parameters) for likelihood in (low_rank, ExactProfiledLikelihood(samples))
    )
    assert approximate is not None
    assert exact is not None
    assert approximate.nlml == pytest.approx(exact.nlml, abs=0.01)


@settings(max_examples=25)
@given(
    st.integers(12, 120),
    st.integers(1, 4),
    st.floats(-1.0, 2.0),
    st.floats(-6.0, 1.0),
    st.floats(1e-10, 1e-3),
    st.integers(0, 10**6),
)
def test_certificate_brackets_the_exact_likelihood(
    count: int, dimensions: int, log_length: float, log_rho: float, tolerance: float, seed: int
) -> None:
    x, y = make_samples(count, dimensions, seed)
    samples = MergedSamples.of(x, y)
    parameters = np.append(np.full(dimensions, log_length), log_rho)
    factor = pivoted_cholesky(samples.inputs / np.exp(log_length), tolerance, count)
    fit = NystromFit(samples, factor.rows, float(np.exp(log_rho)))
    exact = ExactProfiledLikelihood(samples).evaluate(parameters)
    assert exact is not None
    trace = float(samples.root_count**2 @ factor.residual)
    certificate = certify(fit, trace, exact.profile.plane, exact.profile.scale)
    slack = 1e-6 * (1 + abs(exact.nlml))
    assert certificate.lower - slack <= exact.nlml <= certificate.upper + slack


@settings(max_examples=25)
@given(st.integers(1, 60), st.integers(1, 3), st.floats(0.05, 5.0), st.integers(0, 10**6))
def test_pivoted_cholesky_leaves_what_it_says(count: int, dimensions: int, length: float, seed: int) -> None:
    points = np.random.default_rng(seed).standard_normal((count, dimensions)) / length
    gram = np.exp(-0.5 * ((points[:, None] - points[None]) ** 2).sum(axis=-1))
    factor = pivoted_cholesky(points, 1e-6, count)
    left = gram - factor.rows.T @ factor.rows
    np.testing.assert_allclose(np.diag(left), factor.residual, atol=1e-9)
    assert np.abs(left).max() <= 1e-6 + 1e-9
    assert np.linalg.eigvalsh(left).min() > -1e-8
    corner = factor.corner()
    np.testing.assert_allclose(corner @ corner.T, gram[np.ix_(factor.pivots, factor.pivots)], atol=1e-6)
    assert factor.complete
