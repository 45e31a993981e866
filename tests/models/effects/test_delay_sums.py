"""Sums that delays and faults are judged by equal what they stand for, worked out directly."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.signal import lfilter

from glovecal_models.effects.delay.delay_grid import crossed_with, squared_beside
from glovecal_models.effects.delay.moved_angles import low_passed, running_sums, window_means
from glovecal_models.effects.sensor_fault.short_faults import straight_line


def test_filters_at_the_rows_are_those_of_the_whole_signal() -> None:
    random = np.random.default_rng(1)
    # Straight between every second sample, as is exact.
    coarse = [np.cumsum(random.standard_normal(count)) for count in (120, 75)]
    signals = [np.interp(np.arange(2 * len(part) - 1) / 2, np.arange(len(part)), part) for part in coarse]
    rows = [np.arange(4, 230, 6), np.arange(140, 0, -8)]
    tau = np.array([1.5, 9.0, 40.0])
    in_a_row = np.array([[5.0], [12.0]])
    each_signal = low_passed(signals, rows, tau, in_a_row)
    rested = [np.full(len(index), part[0]) for part, index in zip(coarse, rows, strict=True)]
    found = np.concatenate(each_signal) + np.concatenate(rested)[:, None]
    first, second = (np.concatenate(low_passed(signals, rows, each)) for each in in_a_row)
    two = (5.0 * first - 12.0 * second) / (5.0 - 12.0)
    np.testing.assert_allclose(np.concatenate(each_signal)[:, 3:], two, rtol=1e-10, atol=1e-10)
    found = found[:, :3]
    for each, constant in zip(found.T, tau, strict=True):
        h = 2.0 / constant
        e = np.exp(-h)
        gain = (1 - e) / h
        whole = [
            part[0] + lfilter([1 - gain, gain - e], [1.0, -e], part - part[0])[index // 2]
            for part, index in zip(coarse, rows, strict=True)
        ]
        np.testing.assert_allclose(each, np.concatenate(whole), rtol=1e-10, atol=1e-10)


def test_squares_in_blocks_are_those_of_the_residual_of_a_base() -> None:
    random = np.random.default_rng(2)
    target, slope = random.standard_normal((2, 90))
    moved, starts = random.standard_normal((7, 90)), np.array([0, 20, 55])
    orthogonal = np.linalg.qr(random.standard_normal((90, 6)))[0]
    left = target - moved * slope
    left -= (left @ orthogonal) @ orthogonal.T
    expected = np.add.reduceat(left**2, starts, axis=1).T
    beside = target - moved * slope
    blocks = [
        crossed_with(beside[:4, first:end], beside[4:, first:end].T, orthogonal[first:end])
        for first, end in pairwise([*starts.tolist(), 90])
    ]
    np.testing.assert_allclose(squared_beside(blocks, orthogonal, starts), expected, rtol=1e-10)


def test_window_means_are_those_of_straight_lines() -> None:
    signal, rows = np.random.default_rng(3).standard_normal(200), np.arange(40, 160, 8)
    newest, oldest = np.array([0.0, -16.0, 2.4]), np.array([10.0, 0.0, 9.6])
    found = np.empty((3, len(rows)))
    window_means(running_sums(signal), rows, newest, oldest, found)
    for mean, new, old in zip(found, newest, oldest, strict=True):
        at = rows[:, None] - np.array([new, old])
        # A running sum is itself read along straight lines between samples.
        sums = np.interp(at, np.arange(200), running_sums(signal))
        np.testing.assert_allclose(mean, (sums[:, 0] - sums[:, 1]) / (old - new), rtol=1e-10, atol=1e-12)


def test_a_straight_line_is_that_of_polyfit() -> None:
    x, y = np.random.default_rng(4).uniform(20, 90, (2, 50))
    np.testing.assert_allclose(straight_line(x, y), np.polyfit(x, y, 1), rtol=1e-9)
