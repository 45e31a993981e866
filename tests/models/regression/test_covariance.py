"""Covariance functions: independent formulas, gradients by differences, sums, samples, save and restore."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import cdist

from glovecal_models.covariance.base import Covariance, restore_covariance
from glovecal_models.covariance.functions import (
    LinearArd,
    Polynomial,
    SquaredExponential,
    SquaredExponentialArd,
)
from glovecal_models.errors import DamagedArtifact

EVERY = [
    LinearArd(),
    SquaredExponential(),
    SquaredExponentialArd(),
    Polynomial(1),
    Polynomial(3),
    LinearArd() + SquaredExponentialArd(),
    SquaredExponentialArd() + SquaredExponentialArd(),
    Polynomial(2) + LinearArd() + SquaredExponential(),
]
every = pytest.mark.parametrize("covariance", EVERY, ids=repr)


def some_points(covariance: Covariance, dimensions: int = 3, seed: int = 0):
    generator = np.random.default_rng(seed)
    theta = generator.normal(scale=0.5, size=len(covariance.parameter_names(dimensions)))
    return theta, generator.normal(size=(7, dimensions)), generator.normal(size=(5, dimensions)), generator


def central_differences(function, at: np.ndarray, step: float = 1e-6) -> np.ndarray:
    """Gradient of a number by every entry of ``at``, to about 1e-9."""
    gradient = np.empty(at.shape)
    for index in np.ndindex(at.shape):
        high, low = at.copy(), at.copy()
        high[index] += step
        low[index] -= step
        gradient[index] = (function(high) - function(low)) / (2 * step)
    return gradient


def test_values_are_the_formulas_of_the_paper() -> None:
    generator = np.random.default_rng(3)
    a, b = generator.normal(size=(6, 3)), generator.normal(size=(4, 3))
    eta, gamma, beta = 1.7, np.array([0.3, 2.0, 0.9]), np.array([0.5, 1.1, 4.0])
    smooth = eta * np.exp(-0.5 * cdist(a, b, "sqeuclidean", w=gamma))
    assert SquaredExponentialArd()(np.log([eta, *gamma]), a, b) == pytest.approx(smooth, rel=1e-13)
    linear = np.einsum("d,id,jd->ij", beta, a, b)
    assert LinearArd()(np.log(beta), a, b) == pytest.approx(linear, rel=1e-13)
    isotropic = eta * np.exp(-0.5 * 0.8 * cdist(a, b, "sqeuclidean"))
    assert SquaredExponential()(np.log([eta, 0.8]), a, b) == pytest.approx(isotropic, rel=1e-13)
    cubic = 2.0 * (a @ b.T + 0.7) ** 3
    assert Polynomial(3)(np.log([2.0, 0.7]), a, b) == pytest.approx(cubic, rel=1e-13)
    both = LinearArd() + SquaredExponentialArd()
    assert both(np.log([*beta, eta, *gamma]), a, b) == pytest.approx(linear + smooth, rel=1e-13)


def test_squared_exponential_keeps_its_digits_far_from_the_origin() -> None:
    """Expanded distances lose digits with the offset; the points are moved before."""
    generator = np.random.default_rng(4)
    a = generator.normal(size=(20, 2))
    near = SquaredExponentialArd()(np.zeros(3), a, a)
    assert SquaredExponentialArd()(np.zeros(3), a + 1e4, a + 1e4) == pytest.approx(near, abs=1e-10)


@every
def test_gradients_agree_with_finite_differences(covariance: Covariance) -> None:
    theta, a, b, generator = some_points(covariance)
    weights = generator.normal(size=(7, 5))
    by_theta, by_a = covariance.pullback(theta, a, b, weights)
    numerical_theta = central_differences(lambda t: float(np.sum(weights * covariance(t, a, b))), theta)
    numerical_a = central_differences(lambda p: float(np.sum(weights * covariance(theta, p, b))), a)
    assert by_theta == pytest.approx(numerical_theta, rel=1e-6, abs=1e-6)
    assert by_a == pytest.approx(numerical_a, rel=1e-6, abs=1e-6)


@every
def test_diagonal_and_its_gradients(covariance: Covariance) -> None:
    theta, a, _, generator = some_points(covariance)
    weights = generator.normal(size=7)
    assert covariance.diagonal(theta, a) == pytest.approx(np.diagonal(covariance(theta, a, a)), rel=1e-12)
    by_theta, by_a = covariance.diagonal_pullback(theta, a, weights)
    numerical_theta = central_differences(lambda t: float(weights @ covariance.diagonal(t, a)), theta)
    numerical_a = central_differences(lambda p: float(weights @ covariance.diagonal(theta, p)), a)
    assert by_theta == pytest.approx(numerical_theta, rel=1e-6, abs=1e-6)
    assert by_a == pytest.approx(numerical_a, rel=1e-6, abs=1e-6)


@every
def test_twice_the_pullback_is_the_gradient_of_a_symmetric_matrix(covariance: Covariance) -> None:
    theta, a, _, generator = some_points(covariance)
    weights = generator.normal(size=(7, 7))
    weights += weights.T
    _, by_a = covariance.pullback(theta, a, a, weights)
    numerical = central_differences(lambda p: float(np.sum(weights * covariance(theta, p, p))), a)
    assert 2 * by_a == pytest.approx(numerical, rel=1e-5, abs=1e-5)


@every
@settings(max_examples=20)
@given(seed=st.integers(0, 10**6), dimensions=st.integers(1, 6))
def test_every_matrix_is_symmetric_and_positive_semidefinite(covariance, seed, dimensions) -> None:
    theta, a, _, _ = some_points(covariance, dimensions, seed)
    values = covariance(theta, a, a)
    assert np.array_equal(values, values.T) or values == pytest.approx(values.T, rel=1e-12)
    assert np.linalg.eigvalsh(values).min() >= -1e-10 * values.max()


@every
def test_scaled_theta_scales_the_covariance(covariance: Covariance) -> None:
    theta, a, b, _ = some_points(covariance)
    assert covariance(covariance.scaled(theta, 9.0), a, b) == pytest.approx(9.0 * covariance(theta, a, b))


@every
def test_initial_and_bounds_and_names_fit_together(covariance: Covariance) -> None:
    generator = np.random.default_rng(5)
    x, y = generator.normal(size=(50, 4)), generator.normal(size=50)
    names = covariance.parameter_names(4)
    start, bounds = covariance.initial(x, y), covariance.bounds(4)
    assert len(names) == len(set(names)) == len(start) == len(bounds)
    assert all(low < value < high for value, (low, high) in zip(start, bounds, strict=True))


@every
def test_restored_covariance_has_the_same_values(covariance: Covariance) -> None:
    theta, a, b, _ = some_points(covariance)
    again = restore_covariance(json.loads(json.dumps(covariance.settings())))
    assert repr(again) == repr(covariance)
    assert np.array_equal(again(theta, a, b), covariance(theta, a, b))


def test_sum_is_flat_associative_and_starts_repeated_terms_apart() -> None:
    smooth, linear = SquaredExponentialArd(), LinearArd()
    assert repr((smooth + linear) + smooth) == repr(smooth + (linear + smooth))
    assert len(((smooth + linear) + (smooth + smooth)).parts()) == 4
    generator = np.random.default_rng(6)
    start = (smooth + smooth).initial(generator.normal(size=(9, 1)), generator.normal(size=9))
    assert start[0] != start[2]


def test_samples_of_independent_processes_add_up_to_samples_of_the_sum() -> None:
    """Empirical covariance of f + g over 40 000 draws against k_f + k_g, within five standard errors."""
    generator = np.random.default_rng(7)
    x = np.linspace(-1.5, 1.5, 4)[:, None]
    f, g = LinearArd(), SquaredExponentialArd()
    theta_f, theta_g = np.log([0.6]), np.log([1.3, 2.0])
    draws = np.zeros((40_000, 4))
    for k, theta in ((f, theta_f), (g, theta_g)):
        draws += generator.multivariate_normal(np.zeros(4), k(theta, x, x), size=40_000, method="eigh")
    expected = (f + g)(np.concatenate([theta_f, theta_g]), x, x)
    empirical = draws.T @ draws / len(draws)
    variances = np.diagonal(expected)
    standard_error = np.sqrt((np.outer(variances, variances) + expected**2) / len(draws))
    assert (np.abs(empirical - expected) < 5 * standard_error).all()


@pytest.mark.parametrize("degree", [0, 9, 2.0, True, None, "2"])
def test_polynomial_refuses_a_degree_it_does_not_have(degree) -> None:
    with pytest.raises(ValueError, match="whole number from 1 to 8"):
        Polynomial(degree)
    with pytest.raises(DamagedArtifact, match="whole number from 1 to 8"):
        restore_covariance({"kind": "polynomial", "degree": degree})
