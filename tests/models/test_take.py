"""Takes: shapes are checked, references are interpolated but never invented."""

import numpy as np
import pytest

from glovecal_models.errors import BadInput
from glovecal_models.takes.take import Take


def take(**changes):
    time = np.arange(5) / 10
    values = {
        "name": "t",
        "wearing": "w",
        "sensors": ("A",),
        "time_s": time,
        "readings": np.arange(5.0)[:, None],
        "rotations": ("R",),
        "reference_time_s": time,
        "reference": np.arange(5.0)[:, None] * 2,
    }
    return Take(**{**values, **changes})


def test_reference_on_the_same_clock_is_given_as_it_is():
    reference = np.array([[0.0], [np.nan], [4.0], [6.0], [8.0]])
    result = take(reference=reference).reference_at_frames(["R", "UNMEASURED"])
    np.testing.assert_array_equal(result[:, 0], reference[:, 0])
    assert np.isnan(result[:, 1]).all()


def test_a_faster_reference_is_interpolated_and_not_extrapolated():
    time = np.arange(0.05, 0.35, 0.01)
    result = take(reference_time_s=time, reference=time[:, None] * 100).reference_at_frames(["R"])[:, 0]
    np.testing.assert_allclose(result[1:4], [10, 20, 30])
    assert np.isnan(result[[0, 4]]).all()


def test_nothing_is_interpolated_across_a_gap():
    time = np.array([0.0, 0.05, 0.1, 0.35, 0.4])
    result = take(reference_time_s=time, reference=time[:, None]).reference_at_frames(["R"])[:, 0]
    assert np.isfinite(result[[0, 1, 4]]).all()
    assert np.isnan(result[[2, 3]]).all()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"readings": np.zeros((4, 1))}, "readings has shape"),
        ({"readings": np.full((5, 1), np.nan)}, "NaN or infinity"),
        ({"time_s": np.array([0, 1, 1, 2, 3.0])}, "must increase"),
        ({"time_s": np.array([0, 1, np.nan, 2, 3.0])}, "NaN"),
        ({"context": {"supply_v": np.zeros(4)}}, "context supply_v"),
        ({"poses": ("flat",)}, "1 pose names for 5 frames"),
    ],
)
def test_refusals(changes, message):
    with pytest.raises(BadInput, match=message):
        take(**changes)
