"""Representative samples and held-out folds: nothing lost, nothing random where time matters."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glovecal_models.calibration.folds import folds_over_takes
from glovecal_models.calibration.samples import (
    Samples,
    linear_correspondence,
    linear_samples,
    representative_index,
)
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.errors import BadInput
from glovecal_models.layout import Layout


def samples(inputs, target, take=None, poses=None):
    count = len(target)
    return Samples(
        np.asarray(inputs, dtype=float).reshape(count, -1),
        np.asarray(target, dtype=float),
        np.zeros(count, dtype=int) if take is None else np.asarray(take),
        np.array([""] * count if poses is None else poses, dtype=object),
    )


def test_a_long_hold_weighs_no_more_than_a_short_one():
    rng = np.random.default_rng(1)
    held = np.r_[np.zeros(9000), np.linspace(0, 90, 1000)]
    given_samples = samples(held + rng.normal(0, 0.1, 10000), held)
    chosen = representative_index(given_samples, 500)
    assert len(chosen) == 500
    assert np.mean(given_samples.target[chosen] > 5) > 0.7  # 10 % of the frames, most of the space


@given(st.integers(1, 400), st.integers(1, 60), st.integers(1, 5), st.integers(0, 3))
def test_representatives_are_distinct_in_order_and_no_more_than_asked(count, wanted, takes, seed):
    rng = np.random.default_rng(seed)
    given_samples = samples(rng.normal(size=(count, 2)), rng.normal(size=count), np.arange(count) % takes)
    index = representative_index(given_samples, wanted, seed=seed)
    assert len(index) == min(count, wanted)
    assert (np.diff(index) > 0).all()


def test_every_take_is_represented():
    take = np.repeat([0, 1, 2], [3000, 3000, 20])
    given_samples = samples(np.random.default_rng(0).normal(size=6020), np.arange(6020), take)
    chosen = representative_index(given_samples, 300)
    assert set(take[chosen]) == {0, 1, 2}


def test_folds_leave_out_whole_takes_once_each():
    take = np.repeat([0, 1, 2, 3, 4], 10)
    folds = folds_over_takes(take, 3)
    assert np.array_equal(sum(fold.held_out.astype(int) for fold in folds), np.ones(50))
    for fold in folds:
        for owner in range(5):
            assert len(set(fold.held_out[take == owner])) == 1


def test_one_take_is_cut_into_stretches_of_time():
    folds = folds_over_takes(np.zeros(800, dtype=int), 2)
    assert np.array_equal(sum(fold.held_out.astype(int) for fold in folds), np.ones(800))
    assert all(np.count_nonzero(np.diff(fold.held_out.astype(int))) <= 8 for fold in folds)
    assert folds_over_takes(np.zeros(10, dtype=int), 0) == []


@pytest.mark.parametrize("folds", [1, -1])
def test_a_fold_that_would_hold_out_everything_is_refused(folds):
    with pytest.raises(BadInput, match=f"folds is {folds}"):
        TrainingSettings(folds=folds)


def test_a_linear_calibration_reads_the_measuring_sensor_at_the_key_poses():
    correspondence = Layout.built_in("cyberglove18").correspondence("IM_ABD")
    assert linear_correspondence(correspondence).sensors == ("IM_ABD",)
    given_samples = samples([1, 2, 3, 4], [0, 5, 10, 15], poses=["flat", "", "fist", ""])
    assert linear_samples(given_samples).target.tolist() == [0, 10]
    hardly_moving = samples([1, 2, 3, 4], [0, 80, 1, 160], poses=["flat", "", "fist", ""])
    assert len(linear_samples(hardly_moving)) == 4
    without_poses = samples([1, 2, 3, 4], [0, 5, 10, 15])
    assert len(linear_samples(without_poses)) == 4
