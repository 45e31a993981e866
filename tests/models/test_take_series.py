"""A take as it is drawn: nothing that could be seen is lost, whatever is left out."""

from __future__ import annotations

import numpy as np

from glovecal_models.takes.take import Take
from glovecal_models.takes.take_series import take_series


def take_of(readings: np.ndarray, *, rate_hz: float = 100.0, time_s: np.ndarray | None = None) -> Take:
    time_s = np.arange(len(readings)) / rate_hz + 7.0 if time_s is None else time_s
    names = tuple(f"S{at}" for at in range(readings.shape[1]))
    return Take(
        name="t", wearing="w", sensors=names, time_s=time_s, readings=readings, rotations=("I_PIP",),
        reference_time_s=time_s[::2], reference=readings[::2, :1] / 10.0,
    )  # fmt: skip


def test_no_extreme_of_a_long_take_is_lost() -> None:
    readings = np.random.default_rng(3).normal(500, 5, (50_000, 3))
    readings[31_234, 1] = 4000.0
    found = take_series(take_of(readings), points=500)
    assert len(found.readings.at) <= 500
    assert found.readings.at[0] == 0.0
    for column, shown in zip(readings.T, np.asarray(found.readings.values, float), strict=True):
        assert (shown.min(), shown.max()) == (column.min(), column.max())


def test_a_window_has_every_frame_that_is_in_it() -> None:
    readings = np.random.default_rng(3).normal(500, 5, (5000, 2))
    found = take_series(take_of(readings), from_s=10.0, to_s=11.0)
    np.testing.assert_allclose(found.readings.at, np.arange(1000, 1101) / 100.0)
    np.testing.assert_array_equal(found.readings.values[0], readings[1000:1101, 0])


def test_missing_frames_are_where_they_are_missing() -> None:
    time_s = np.concatenate([np.arange(0, 2, 0.01), np.arange(2.5, 4, 0.01)])
    found = take_series(take_of(np.random.default_rng(1).normal(0, 1, (len(time_s), 1)), time_s=time_s))
    np.testing.assert_allclose(found.gaps, [(1.99, 2.5)])


def test_a_spectrum_shows_a_movement_at_its_frequency_with_its_amplitude() -> None:
    time_s = np.arange(6000) / 100.0
    readings = np.column_stack([30.0 * np.sin(2 * np.pi * 5.0 * time_s), np.zeros(6000) + 7.0])
    found = take_series(take_of(readings)).spectra
    first, second = np.asarray(found.values, float)
    peak = int(np.argmax(first))
    width_hz = found.at[1] - found.at[0]
    assert abs(found.at[peak] - 5.0) <= width_hz
    whole = np.sqrt(np.square(first).sum())
    assert abs(whole / 30.0 - np.sqrt(1.5)) < 0.01  # a Hann window spreads it over three lines: 1, 1/2, 1/2
    assert second.max() < 1e-9


def test_what_was_not_measured_is_told_so() -> None:
    take = take_of(np.random.default_rng(1).normal(0, 1, (300, 1)))
    take.reference[10:20] = np.nan
    found = take_series(take)
    assert found.reference.values[0][10:20] == [None] * 10
