"""Dependence of errors on columns: the shift test holds its level on errors that are alike in time."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_models.comparison.dependence import Covariate, _shifted_sums, dependence


def test_all_shifts_at_once_are_the_shifts_one_by_one():
    generator = np.random.default_rng(0)
    error, where = generator.normal(size=50), generator.integers(0, 3, 50)
    sums = _shifted_sums(error, where, 3)
    for shift in range(50):
        rolled = np.roll(error, -shift)
        np.testing.assert_allclose(
            sums[:, shift], [rolled[where == number].sum() for number in range(3)], atol=1e-10
        )


def test_unrelated_series_seem_related_no_more_often_than_claimed(slow):
    """Plain correlation would: 4 takes of 25 s hold only some 60 independent values."""
    generator = np.random.default_rng(1)
    found = []
    for _ in range(200):
        errors = tuple(slow(generator, 1500, 1.5) for _ in range(4))
        column = Covariate("x", "", "x", tuple(slow(generator, 1500, 1.0) for _ in range(4)))
        result = dependence(errors, column, generator)
        assert result is not None
        found.append(result.p_value)
    rejected = np.mean(np.array(found) <= 0.05)
    assert 0.01 <= rejected <= 0.10  # 200 trials at a level of 0.05: 95 % of the time within 0.02 to 0.08


def test_a_planted_bend_is_found_with_its_size(slow):
    generator = np.random.default_rng(2)
    values = tuple(slow(generator, 1500, 1.0) for _ in range(4))
    errors = tuple(0.7 * (value**2 - 1) + slow(generator, 1500, 1.5) for value in values)
    result = dependence(errors, Covariate("x", "", "x", values), generator)
    assert result is not None
    assert result.p_value == pytest.approx(0.001)
    assert result.explained_deg == pytest.approx(0.7 * np.sqrt(2), rel=0.25)
    assert result.mean_deg[0] > 0.5 < result.mean_deg[-1]
    assert result.mean_deg[len(result.mean_deg) // 2] < 0
    assert sum(result.count) == 6000
    assert result.chance_deg[0] is not None
    assert result.mean_deg[0] > result.chance_deg[0]


def test_columns_that_cannot_tell():
    generator = np.random.default_rng(3)
    error = (generator.normal(size=100),)
    assert dependence(error, Covariate("x", "", "x", (np.full(100, 3.0),)), generator) is None
    assert dependence(error, Covariate("x", "", "x", (np.full(100, np.nan),)), generator) is None
    few = dependence((error[0][:10],), Covariate("x", "", "x", (np.arange(10.0),)), generator)
    assert few is not None
    assert few.p_value == 1.0
