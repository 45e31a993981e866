"""The noise floor: planted noise comes back inside its interval, motion and drift stay out."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_models.comparison.noise_floor import noise_floor


@pytest.mark.parametrize("noise", [0.3, 1.5])
def test_still_holds_give_the_noise_whatever_the_error_between_them(take_residuals, together, holds, noise):
    generator = np.random.default_rng(4)
    angle = holds(12)
    error = 0.1 * angle + noise * generator.normal(size=len(angle))
    floor = noise_floor(together(take_residuals(angle, error, angle)), "A")
    assert floor is not None
    assert (floor.how, floor.is_lower_bound) == ("still hand", False)
    assert floor.pieces >= 8
    repeats = noise / 1.1  # the map takes the slope of 1.1 out of the readings, and so of their noise
    assert floor.low_deg <= repeats * 1.03
    assert floor.high_deg >= repeats * 0.97
    assert floor.floor_deg == pytest.approx(repeats, rel=0.1)


def test_a_neighbour_that_moves_during_the_holds_is_told(take_residuals, together, holds):
    generator = np.random.default_rng(12)
    angle = holds(12)
    other = 20 * np.sin(np.arange(len(angle)) / 15)
    error = 0.1 * other + 0.5 * generator.normal(size=len(angle))
    floor = noise_floor(together(take_residuals(angle, error, other)), "A")
    assert floor is not None
    assert floor.how == "still joint"
    rests = np.where(np.arange(len(angle)) < len(angle) // 2, 0.0, other)  # the neighbour rests half the time
    floor = noise_floor(together(take_residuals(angle, error - 0.1 * other, rests)), "A")
    assert floor is not None
    assert (floor.how, floor.floor_deg) == ("still hand", pytest.approx(0.5, rel=0.1))


def test_without_holds_the_white_part_is_a_lower_bound(take_residuals, together, slow):
    generator = np.random.default_rng(5)
    angle = 40 + 30 * np.sin(np.arange(3000) / 25)
    error = 2.0 * slow(generator, 3000, 1.0) + 0.4 * generator.normal(size=3000)
    floor = noise_floor(together(take_residuals(angle, error, angle)), "A")
    assert floor is not None
    assert floor.is_lower_bound
    assert floor.low_deg < floor.floor_deg < floor.high_deg
    assert floor.floor_deg == pytest.approx(0.4, rel=0.6)  # the slow part's own steps are in it
    assert floor.floor_deg < 1.0


def test_hardly_any_measurement_gives_no_floor(take_residuals, together):
    angle = np.array([1.0, np.nan, np.nan, 2.0, np.nan])
    found = together(take_residuals(angle, np.zeros(5), np.zeros(5)))
    assert noise_floor(found, "A") is None
