"""What is left out where takes cannot be left out whole."""

import numpy as np

from glovecal_models.calibration.folds import are_short, held_levels, pieces


def test_angles_held_one_after_another_are_left_out_one_by_one():
    reference = np.repeat([0.0, 10.0, 20.0, 30.0, 40.0], 20)[:, None]
    assert held_levels(reference) == [slice(k, k + 20) for k in range(0, 100, 20)]


def test_motion_is_left_out_in_quarters():
    reference = np.linspace(0, 90, 100)[:, None]
    assert held_levels(reference) is None
    assert pieces(np.arange(100.0), reference) == [slice(k, k + 25) for k in range(0, 100, 25)]


def test_short_takes_are_those_of_a_few_seconds():
    assert are_short([np.arange(0, 6, 0.1)] * 3)
    assert not are_short([np.arange(0, 40, 0.1)] * 3)
