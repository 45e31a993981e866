"""Residuals as numbers: the density of the errors under the claims, and the floor beside every RMSE."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from glovecal_models.comparison.compare import summed_up
from glovecal_models.comparison.floor_estimate import NoiseFloor, joined
from glovecal_models.comparison.residuals import Residuals, TakeResiduals


@pytest.fixture
def claimed(
    take_residuals: Callable[..., TakeResiduals], together: Callable[..., Residuals]
) -> Callable[[float], Residuals]:
    """Errors of standard deviation 2 with a claimed one."""

    def make(sd: float) -> Residuals:
        error = 2.0 * np.random.default_rng(1).normal(size=4000)
        angle = 40.0 * np.sin(np.arange(4000) / 50.0)
        item = take_residuals(angle, error, angle)
        return together(replace(item, sd=np.full((4000, 1), sd)))

    return make


def test_nlpd_is_that_of_the_normal_distribution_and_least_for_the_truth(
    claimed: Callable[[float], Residuals],
) -> None:
    found = {sd: summed_up(claimed(sd)).overall.nlpd for sd in (1.0, 2.0, 4.0)}
    errors = claimed(2.0).stacked("error")
    assert found[2.0] == pytest.approx(-norm.logpdf(errors, 0, 2.0).mean())
    assert found[1.0] is not None
    assert found[4.0] is not None
    assert min(found, key=lambda sd: found[sd] or np.inf) == 2.0
    assert found[2.0] == pytest.approx(np.log(2.0) + 1.42, abs=0.05)


@pytest.mark.parametrize("sd", [0.0, np.nan])
def test_without_a_claim_there_is_no_nlpd(claimed: Callable[[float], Residuals], sd: float) -> None:
    found = summed_up(claimed(sd))
    assert found.overall.nlpd is None
    assert found.rotations["A"].nlpd is None


def test_the_floor_stands_beside_the_rmse(claimed: Callable[[float], Residuals]) -> None:
    found = summed_up(claimed(2.0))
    floor, overall = found.rotations["A"].floor, found.overall.floor
    assert floor is not None
    assert overall is not None
    assert floor.low_deg <= floor.floor_deg <= floor.high_deg
    assert floor.floor_deg == pytest.approx(2.0, rel=0.1)
    assert (floor.how, floor.is_lower_bound) == ("spectrum", True)
    assert overall.floor_deg == pytest.approx(floor.floor_deg)
    assert (overall.how, overall.reasons) == (floor.how, floor.reasons)


def test_floors_are_joined_by_their_squares_and_are_as_good_as_the_weakest() -> None:
    first = NoiseFloor(1.0, 0.9, 1.1, 0.5, "still hand", 9)
    second = NoiseFloor(2.0, 1.0, 3.0, 0.5, "spectrum", 5)
    both = joined([first, second], [300, 100])
    assert both.floor_deg == pytest.approx(np.sqrt(0.75 * 1 + 0.25 * 4))
    assert (both.how, both.pieces, both.is_lower_bound) == ("spectrum", 5, True)
    assert both.low_deg == pytest.approx(np.sqrt(0.75 * 0.81 + 0.25))
