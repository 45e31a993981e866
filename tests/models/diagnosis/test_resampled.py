"""Takes on even times: no delay comes in, nothing is made up across gaps."""

import numpy as np
import pytest

from glovecal_models.diagnosis.resampled import resampled, shifted, smoothed
from glovecal_models.takes.take import Take


def ramp(time: np.ndarray, reference_time: np.ndarray | None = None) -> Take:
    reference_time = time if reference_time is None else reference_time
    return Take(
        name="t",
        wearing="w",
        sensors=("A",),
        time_s=time,
        readings=3.0 * time[:, None],
        rotations=("A",),
        reference_time_s=reference_time,
        reference=7.0 * reference_time[:, None],
    )


@pytest.mark.parametrize("rate", [33.0, 60.0, 120.0])
def test_a_straight_line_stays_where_it_was(rate: float):
    random = np.random.default_rng(0)
    time = np.cumsum(random.uniform(0.5, 1.5, 300)) / rate
    even = smoothed(resampled(ramp(time), ["A"], ["A"]), 13)
    inner = slice(10, -10)
    assert even.readings[inner, 0] == pytest.approx(3.0 * even.time_s[inner], abs=1e-9)
    assert even.reference[inner, 0] == pytest.approx(7.0 * even.time_s[inner], abs=1e-9)


def test_a_gap_is_left_open():
    time = np.concatenate([np.arange(0, 2, 1 / 60), np.arange(3, 5, 1 / 60)])
    even = resampled(ramp(time), ["A"], ["A"])
    assert not ((even.time_s > 2.05) & (even.time_s < 2.95)).any()


def test_a_reference_is_read_later():
    time = np.arange(0, 5, 1 / 60)
    even = shifted(resampled(ramp(time), ["A"], ["A"]), 0.1)
    known = np.isfinite(even.reference[:, 0])
    assert even.reference[known, 0] == pytest.approx(7.0 * (even.time_s[known] - 0.1), abs=1e-9)


def test_single_poses_are_left_as_they_are():
    even = resampled(ramp(np.arange(0.0, 50.0, 1.0)), ["A"], ["A"])
    assert even.is_sparse
    assert len(even.time_s) == 50
