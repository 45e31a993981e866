"""What is put into an error stands in the picture of the effect that would make it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from glovecal_models.comparison.effect_picture import EffectPicture, effect_picture
from glovecal_models.comparison.residuals import Residuals, TakeResiduals
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.catalogue import catalogue
from glovecal_models.errors import BadInput

TIME = np.arange(3000) / 60
ANGLE = 45 + 40 * np.sin(2 * np.pi * 0.21 * TIME)
SPEED = np.gradient(ANGLE, TIME)
Make = Callable[..., TakeResiduals]
Together = Callable[..., Residuals]


def noise(seed: int) -> np.ndarray:
    return 0.2 * np.random.default_rng(seed).normal(size=len(TIME))


def shown_over(place: str) -> Effect:
    """Some effect that declares it."""
    return next(each for each in catalogue().values() if each.about.shown_over == place)


def drawn(found: Residuals, place: str) -> EffectPicture:
    return effect_picture(found, shown_over(place), "A")


def test_every_effect_declares_a_picture_that_can_be_drawn(take_residuals: Make, together: Together) -> None:
    context = {name: TIME for each in catalogue().values() for name in each.context}
    other = 30 * np.cos(TIME)
    found = together(take_residuals(ANGLE, 2 + noise(1), other, context=context))
    for each in catalogue().values():
        if each.about.neighbours:
            with pytest.raises(BadInput, match="no other sensor"):
                effect_picture(found, each, "A")
            continue
        picture = effect_picture(found, each, "A")
        assert picture.axis
        assert picture.sentence.endswith(".")
        for line in picture.series:
            assert len(line.at) == len(line.mean_deg) == len(line.chance_deg) > 0
            assert len(line.points_at) == len(line.points_deg)


def test_a_loop_has_two_sides(take_residuals: Make, together: Together) -> None:
    picture = drawn(together(take_residuals(ANGLE, 2 * np.sign(SPEED) + noise(2), TIME)), "angle both ways")
    rising, falling = picture.series
    assert rising.mean_deg == pytest.approx(2, abs=0.3)
    assert falling.mean_deg == pytest.approx(-2, abs=0.3)
    assert "4.0 degrees higher" in picture.sentence


def test_the_slope_over_speed_is_a_time(take_residuals: Make, together: Together) -> None:
    late = take_residuals(ANGLE, -0.04 * SPEED + noise(3), TIME)
    assert "40 ms too late" in drawn(together(late), "speed").sentence


def test_the_error_is_least_where_the_clocks_agree(take_residuals: Make, together: Together) -> None:
    earlier = 45 + 40 * np.sin(2 * np.pi * 0.21 * (TIME - 0.1))
    picture = drawn(together(take_residuals(ANGLE, earlier - ANGLE, TIME)), "clock shift")
    line = picture.series[0]
    assert line.at[np.argmin(line.mean_deg)] == pytest.approx(100)
    assert picture.unit == "ms"


def test_a_drift_in_holds_is_told_apart_by_where_the_joint_came_from(
    take_residuals: Make, together: Together
) -> None:
    ramp = np.interp(TIME % 16, [0, 1, 7, 8, 16], [10, 70, 70, 10, 10])
    since = np.where(TIME % 16 < 8, TIME % 16 - 1, TIME % 16 - 8)
    sign = np.where(TIME % 16 < 8, 1, -1)
    drift = 2 * sign * (1 - np.exp(-np.maximum(since, 0) / 2))
    up, down = drawn(together(take_residuals(ramp, drift + 0.1 * noise(4), TIME)), "hold").series
    assert up.mean_deg[-1] == pytest.approx(1.6, abs=0.4)
    assert down.mean_deg[-1] == pytest.approx(-1.6, abs=0.4)
    moving = drawn(together(take_residuals(ANGLE, noise(5), TIME)), "hold")
    assert moving.series == ()
    assert "hold poses" in moving.sentence


def test_wearings_stand_side_by_side(take_residuals: Make, together: Together) -> None:
    takes = [
        take_residuals(ANGLE, shift + noise(6), TIME, name=name, wearing=wearing)
        for name, wearing, shift in (("one", "monday", 1), ("two", "monday", 2), ("three", "friday", -3))
    ]
    picture = drawn(together(*takes), "wearing")
    assert picture.categories == ("monday", "friday")
    assert picture.series[0].mean_deg == pytest.approx([1.5, -3], abs=0.05)
    assert len(picture.series[0].points_at) == 3


def test_the_neighbour_that_explains_most_is_drawn(take_residuals: Make, together: Together) -> None:
    other = 30 * np.cos(1.7 * TIME)
    picture = drawn(together(take_residuals(ANGLE, 0.1 * other + noise(7), other)), "neighbour")
    assert picture.axis == "sensor B"
    line = picture.series[0]
    assert line.mean_deg[-1] - line.mean_deg[0] == pytest.approx(5.5, abs=1)
