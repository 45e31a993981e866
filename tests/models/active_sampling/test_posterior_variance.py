"""The variance after samples is what a refit would give, and no target changes it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glovecal_models.layout import Layout
from glovecal_models.regression.regressor import ProcessRegressor
from glovecal_models.sampling.active.proposal import (
    AssumedProcess,
    PosteriorVariance,
    SampledPoints,
    assumed_process,
    step_errors,
)

LAYOUT = Layout.built_in("cyberglove18")
SENSORS = LAYOUT.sensors


def process(rotation: str = "IM_ABD") -> AssumedProcess:
    low, high = np.full(len(SENSORS), 40.0), np.full(len(SENSORS), 200.0)
    return assumed_process(LAYOUT.correspondence(rotation), low, high, SENSORS)


def points(own: AssumedProcess, count: int, seed: int) -> np.ndarray:
    inputs = np.random.default_rng(seed).uniform(40, 200, (count, len(own.middle)))
    return own.unit(inputs)


def refitted(own: AssumedProcess, at: np.ndarray, noise: np.ndarray, u: np.ndarray) -> np.ndarray:
    """By the product's own regressor, fitted anew to all samples (independent errors)."""
    matrix = own.between(at, at) + np.diag(noise)
    regressor = ProcessRegressor(
        method="gpr",
        input_shift=np.zeros(at.shape[1]),
        input_scale=np.ones(at.shape[1]),
        slope=np.zeros(at.shape[1]),
        intercept=0.0,
        covariance=own.covariance,
        theta=own.theta,
        nodes=at,
        weights=np.random.default_rng(9).standard_normal(len(at)),  # targets: any
        variance_root=np.linalg.cholesky(np.linalg.inv(matrix)),
        noise_variance=1.0,
        jitter=0.0,
    )
    return regressor.predict(u).variance


@pytest.mark.parametrize("rotation", ["I_PIP", "IM_ABD", "T_IP"])
def test_the_expected_variance_is_that_of_a_refit(rotation: str) -> None:
    own = process(rotation)
    first, second, u = (points(own, count, seed) for seed, count in enumerate((12, 7, 30)))
    noise = np.concatenate([np.full(12, 1.7), np.full(7, 0.9)])
    state = PosteriorVariance(own, u, [SampledPoints(first, np.diag(noise[:12]))])
    assert state.variance == pytest.approx(refitted(own, first, noise[:12], u), rel=1e-3)
    after = state.variance - state.fall(SampledPoints(second, np.diag(noise[12:])))
    both = np.concatenate([first, second])
    assert after == pytest.approx(refitted(own, both, noise, u), rel=1e-3, abs=2e-3)


def test_an_error_that_a_step_shares_is_not_averaged_away() -> None:
    """A thousand frames of one pose know its angle no better than the pose is known."""
    own = process("I_PIP")
    u = own.unit(np.array([[120.0]]))
    pose = SampledPoints(u, step_errors(1, 1000.0, 1.3, 2.5))
    (once,) = PosteriorVariance(own, u, [pose]).variance
    assert once == pytest.approx(2.5**2, rel=0.05)
    (twice,) = PosteriorVariance(own, u, [pose, pose]).variance
    assert twice == pytest.approx(2.5**2 / 2, rel=0.05)


def test_without_samples_the_variance_is_the_assumed_one() -> None:
    own = process()
    u = points(own, 5, 0)
    assert PosteriorVariance(own, u, []).variance == pytest.approx(own.alone(u))


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000), steps=st.integers(1, 4))
def test_a_step_never_teaches_less_than_nothing_nor_more_than_there_is(seed: int, steps: int) -> None:
    own = process("T_MCP")
    u = points(own, 10, seed)
    sampled = [
        SampledPoints(points(own, 3, seed + number), step_errors(3, 12.0, 1.3, 1.0))
        for number in range(1, steps + 1)
    ]
    state = PosteriorVariance(own, u, sampled[:-1])
    fall = state.fall(sampled[-1])
    assert (fall > -1e-4).all()
    assert (fall < state.variance + 1e-4).all()
    every = PosteriorVariance(own, u, sampled[::-1])
    assert every.variance == pytest.approx(state.variance - fall, rel=1e-3, abs=1e-3)
