"""Steadied angles: parabolas stay, noise falls, gaps are not bridged."""

from __future__ import annotations

import numpy as np

from glovecal_models.sampling.inverse_kinematics.follow import steadied


def test_parabolas_stay_and_noise_falls() -> None:
    time = np.arange(200) / 60
    curve = np.column_stack([3 + 20 * time - 4 * time**2, 10 * time])
    np.testing.assert_allclose(steadied(time, curve), curve, atol=1e-9)
    noise = np.random.default_rng(0).standard_normal(curve.shape)
    left = steadied(time, curve + noise) - curve
    assert left.std() < 0.6
    assert np.diff(left, axis=0).std() < 0.35


def test_a_gap_belongs_to_no_curve() -> None:
    time = np.concatenate([np.arange(40) / 60, 5 + np.arange(40) / 60, 9 + np.arange(3) / 60])
    steps = np.repeat([[0.0], [50.0], [90.0]], [40, 40, 3], axis=0)
    np.testing.assert_allclose(steadied(time, steps), steps, atol=1e-9)


def test_few_or_rare_frames_stay_as_they_are() -> None:
    for time in (np.array([0.0]), np.arange(3) / 60, np.arange(30) / 5):
        angles = np.random.default_rng(1).normal(size=(len(time), 2))
        np.testing.assert_array_equal(steadied(time, angles), angles)
