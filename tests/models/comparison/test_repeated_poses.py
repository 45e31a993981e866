"""The noise floor from repeated poses: planted repeatability comes back, other errors stay out."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.comparison.noise_floor import noise_floor, rotation_noise
from glovecal_models.comparison.residuals import Residuals, TakeResiduals

LEVELS = {"flat": 0.0, "fist": 80.0, "ok": 45.0}
STAY = 60
REPEATS_DEG = 0.9
"""The map takes the slope of readings over angles, about 1.1 here, out of an error of 1 degree."""


def visited(
    generator: np.random.Generator, visits: int, between: float, within: float
) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """Angle, error and pose names of ``visits`` stays of a second in poses that take turns.

    The error is 4 degrees off in "fist", by ``between`` more or less at every visit, and by ``within`` in
    every frame.
    """
    angle, error, poses = [], [], []
    for visit in range(visits):
        pose = list(LEVELS)[visit % len(LEVELS)]
        off = 4.0 * (pose == "fist") + between * generator.normal()
        angle += [np.full(STAY, LEVELS[pose]), np.linspace(LEVELS[pose], 20, 15)]
        error += [off + within * generator.normal(size=STAY), np.full(15, off)]
        poses += [pose] * STAY + [""] * 15
    return np.concatenate(angle), np.concatenate(error), tuple(poses)


def by_poses(found: Residuals) -> NoiseFloor:
    floors = rotation_noise(found)["A"].floors
    return next(floor for floor in floors if floor.how == "repeated poses")


def test_what_a_pose_repeats_by_is_found_and_its_constant_error_is_not_in_it(
    take_residuals: Callable[..., TakeResiduals], together: Callable[..., Residuals]
) -> None:
    angle, error, poses = visited(np.random.default_rng(1), 60, 0.8, 0.6)
    floor = by_poses(together(take_residuals(angle, error, angle, poses=poses)))
    assert floor.pieces == 57
    assert floor.floor_deg == pytest.approx(REPEATS_DEG, rel=0.15)
    assert floor.low_deg < REPEATS_DEG < floor.high_deg
    assert floor.high_deg - floor.low_deg < 0.4
    assert not floor.is_lower_bound


def test_the_interval_holds_the_truth_as_often_as_it_says(
    take_residuals: Callable[..., TakeResiduals], together: Callable[..., Residuals]
) -> None:
    held = 0
    for trial in range(100):
        angle, error, poses = visited(np.random.default_rng([2, trial]), 33, 0.8, 0.6)
        floor = by_poses(together(take_residuals(angle, error, angle, poses=poses)))
        held += floor.low_deg <= REPEATS_DEG <= floor.high_deg
    assert 85 <= held <= 100


def test_a_pose_in_another_wearing_is_no_repeat(
    take_residuals: Callable[..., TakeResiduals], together: Callable[..., Residuals]
) -> None:
    """Twelve visits of three poses: nine steps in one wearing, three a wearing when each has six visits."""
    angle, error, poses = visited(np.random.default_rng(5), 6, 0.5, 0.1)
    one = together(*(take_residuals(angle, error, angle, name, "monday", poses=poses) for name in "ab"))
    assert by_poses(one).pieces == 9
    shifted = together(
        take_residuals(angle, error, angle, "a", "monday", poses=poses),
        take_residuals(angle, error + 10, angle, "b", "tuesday", poses=poses),
    )
    assert by_poses(shifted).pieces == 6
    assert by_poses(shifted).floor_deg < 1.0


def test_recordings_of_one_frame_a_pose_have_a_floor(
    take_residuals: Callable[..., TakeResiduals], together: Callable[..., Residuals]
) -> None:
    """286 static pairs have no holds; that a pose does not come back to the same angle is all there is."""
    generator = np.random.default_rng(6)
    names = np.tile(list(LEVELS), 40)
    angle = np.array([LEVELS[name] for name in names]) + 2.0 * generator.normal(size=len(names))
    error = 3.0 * generator.normal(size=len(names))
    found = together(take_residuals(angle, error, angle, poses=tuple(names.tolist())))
    floor = noise_floor(found, "A")
    assert floor is not None
    assert floor.how == "repeated poses"
    assert floor.low_deg < 3.0 < floor.high_deg


def test_two_visits_are_too_few(
    take_residuals: Callable[..., TakeResiduals], together: Callable[..., Residuals]
) -> None:
    angle, error, poses = visited(np.random.default_rng(7), 5, 0.5, 0.1)
    found = together(take_residuals(angle, error, angle, poses=poses))
    floors = rotation_noise(found)["A"].floors
    assert "repeated poses" not in [floor.how for floor in floors]
