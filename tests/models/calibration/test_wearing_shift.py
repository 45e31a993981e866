"""The laws of the quick check's update: Gaussian, whatever the order, and least squares in the end."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glovecal_models.calibration.samples import SensorSensitivity
from glovecal_models.quick_check.wearing_shift import (
    OWN_SHARE,
    PoseError,
    WearingShift,
    prior_shift,
    sensor_shift,
)

SENSITIVITY = SensorSensitivity(
    rotations=("I_MCP", "I_PIP", "IM_ABD"),
    sensors=("I_MCP", "I_PIP", "IM_ABD", "UNUSED"),
    slope=np.array([[0.8, 0, 0, 0], [0, -0.5, 0, 0], [0.4, 0, 0.3, 0]]),
    low=np.array([40.0, 60.0, 100.0, np.nan]),
    high=np.array([150.0, 220.0, 180.0, np.nan]),
    centre_deg=np.array([40.0, 45.0, 10.0]),
    spread_deg=np.array([22.0, 20.0, 6.0]),
)
PRIOR = prior_shift(SENSITIVITY)


def poses(seed: int, count: int, known: float = 1.0) -> list[PoseError]:
    random = np.random.default_rng(seed)
    error = random.normal(0, 5, (count, 3))
    error[random.uniform(size=error.shape) > known] = np.nan
    return [
        PoseError(row, joint, variance)
        for row, joint, variance in zip(
            error, random.normal(0, 1, (count, 3)), random.uniform(0.3, 4, (count, 3)), strict=True
        )
    ]


def in_one_step(prior: WearingShift, witnesses: list[PoseError]) -> tuple[np.ndarray, np.ndarray]:
    """Weighted normal equations with the prior as pseudo-observations: another way to the same posterior."""
    precision = np.linalg.inv(prior.covariance)
    right = precision @ prior.mean
    for pose in witnesses:
        for lane in np.flatnonzero(pose.known):
            row = np.zeros(6)
            row[lane], row[3 + lane] = 1.0, pose.joint[lane]
            precision += np.outer(row, row) / pose.variance[lane]
            right += row * pose.error[lane] / pose.variance[lane]
    covariance = np.linalg.inv(precision)
    return covariance @ right, covariance


def test_without_a_pose_the_prior_stays() -> None:
    nothing = PoseError(np.full(3, np.nan), np.zeros(3), np.ones(3))
    for shift in (PRIOR.after([]), PRIOR.after([nothing])):
        np.testing.assert_array_equal(shift.mean, PRIOR.mean)
        np.testing.assert_array_equal(shift.covariance, PRIOR.covariance)


@settings(max_examples=60)
@given(st.integers(0, 10_000), st.integers(1, 8), st.randoms(use_true_random=False))
def test_order_does_not_matter_and_one_by_one_is_all_at_once(seed: int, count: int, shuffle) -> None:
    witnesses = poses(seed, count, known=0.7)
    shuffled = list(witnesses)
    shuffle.shuffle(shuffled)
    one, other = PRIOR.after(witnesses), PRIOR.after(shuffled)
    mean, covariance = in_one_step(PRIOR, witnesses)
    for shift in (one, other):
        np.testing.assert_allclose(shift.mean, mean, rtol=0, atol=1e-8)
        np.testing.assert_allclose(shift.covariance, covariance, rtol=0, atol=1e-8)


@settings(max_examples=40)
@given(st.integers(0, 10_000))
def test_every_pose_takes_uncertainty_away(seed: int) -> None:
    shift = PRIOR
    for pose in poses(seed, 6, known=0.6):
        following = shift.updated(pose)
        lost = shift.covariance - following.covariance
        assert np.linalg.eigvalsh(lost).min() > -1e-9
        assert np.linalg.eigvalsh(following.covariance).min() > 0
        _, sd = sensor_shift(SENSITIVITY, PRIOR, shift)
        _, less = sensor_shift(SENSITIVITY, PRIOR, following)
        assert (less <= sd + 1e-9).all()
        shift = following


def test_many_poses_end_at_least_squares() -> None:
    random = np.random.default_rng(3)
    joint = random.normal(0, 1, (4000, 3))
    error = np.array([4.0, -7.0, 2.0]) + np.array([1.0, 0.0, -2.0]) * joint + random.normal(0, 1, (4000, 3))
    shift = PRIOR.after(PoseError(e, z, np.ones(3)) for e, z in zip(error, joint, strict=True))
    for lane in range(3):
        columns = np.column_stack([np.ones(4000), joint[:, lane]])
        found = np.linalg.lstsq(columns, error[:, lane], rcond=None)[0]
        np.testing.assert_allclose(shift.mean[[lane, 3 + lane]], found, rtol=0, atol=0.01)
    assert np.sqrt(np.diag(shift.covariance)).max() < 0.03


def test_a_rotation_nobody_measured_learns_from_the_sensor_it_shares() -> None:
    """IM_ABD reads sensor I_MCP too: knowing I_MCP's shift tells part of its own; I_PIP learns nothing."""
    pose = PoseError(np.array([8.0, np.nan, np.nan]), np.zeros(3), np.full(3, 0.01))
    shift = PRIOR.updated(pose)
    assert shift.mean[0] == pytest.approx(8.0, abs=0.1)
    assert 1.0 < shift.mean[2] < 4.0, "less than 8 x 0.4 / 0.8: the sensor IM_ABD has a shift of its own"
    assert shift.covariance[2, 2] < 0.8 * PRIOR.covariance[2, 2]
    assert shift.mean[1] == 0.0
    assert shift.covariance[1, 1] == PRIOR.covariance[1, 1]


def test_sensor_shifts_are_in_readings_and_against_the_correction() -> None:
    """I_MCP reads 10 more than before: at 0.8 degrees a reading the correction is -8 degrees."""
    pose = PoseError(np.array([-8.0, np.nan, np.nan]), np.zeros(3), np.full(3, 1e-6))
    readings, sd = sensor_shift(SENSITIVITY, PRIOR, PRIOR.updated(pose))
    assert readings[0] == pytest.approx(10 * np.sqrt(1 - OWN_SHARE)), "the rest is the regressor's own"
    assert readings[1:3] == pytest.approx([0.0, 0.0], abs=1e-9)
    _, before = sensor_shift(SENSITIVITY, PRIOR, PRIOR)
    np.testing.assert_allclose(before[:3], [0.04 * 110, 0.04 * 160, 0.04 * 80])
    assert sd[0] < 0.6 * before[0]


def test_the_default_prior_is_a_share_of_the_trained_range() -> None:
    sd = np.sqrt(np.diag(PRIOR.covariance))
    assert sd[0] == pytest.approx(0.04 * 110 * 0.8)
    assert sd[2] == pytest.approx(np.hypot(0.04 * 110 * 0.4, 0.04 * 80 * 0.3))
    np.testing.assert_allclose(sd[3:], 0.5 * sd[:3])
    learned = prior_shift(SENSITIVITY, np.array([[5.0, 1.0], [2.0, 0.5], [3.0, 2.0]]))
    np.testing.assert_allclose(np.sqrt(np.diag(learned.covariance)), [5, 2, 3, 1, 0.5, 2])


def test_a_pose_that_fits_is_no_surprise_and_a_mistaken_one_is() -> None:
    fits = PoseError(np.array([3.0, -3.0, 1.0]), np.zeros(3), np.ones(3))
    fist_for_flat = PoseError(np.array([80.0, 90.0, 0.0]), np.ones(3), np.ones(3))
    assert PRIOR.contradiction(fits) < 2
    assert PRIOR.contradiction(fist_for_flat) > 100
