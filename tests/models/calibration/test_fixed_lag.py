"""Estimates with a stated delay: between filter and offline, never by what comes later, frame by frame."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from glovecal_models.calibration.fixed_lag import FIRST_KEPT, FixedLagSmoother, delayed, last_seen
from glovecal_models.calibration.motion_smoother import SHORTEST_RUN, smoothed

RATE_HZ = 100.0
DELAYS_S = (0.0, 0.02, 0.05, 0.1, 0.2, 0.5)


def noisy(frames: int, joints: int, seed: int, noise_deg: float = 1.0) -> tuple[np.ndarray, ...]:
    """Times (N,), smooth angles and measured ones (N, L), degrees, all known."""
    random = np.random.default_rng(seed)
    time_s = np.arange(frames) / RATE_HZ
    speed_hz, phase = random.uniform(0.1, 0.8, (4, joints)), random.uniform(0, 6, (4, joints))
    truth = 10 * np.sin(2 * np.pi * speed_hz * time_s[:, None, None] + phase).sum(axis=1)
    measured = truth + noise_deg * random.standard_normal(truth.shape)
    return time_s, truth, measured, np.ones(truth.shape, bool)


def test_more_delay_leaves_less_and_comes_to_what_offline_leaves() -> None:
    time_s, truth, measured, known = noisy(2500, 6, 1)
    motions = delayed(time_s, measured, known, (*DELAYS_S, np.inf))
    left = [float(np.sqrt(np.mean((each.state[300:, :, 0] - truth[300:]) ** 2))) for each in motions]
    assert all(more < less for less, more in itertools.pairwise(left[:-1]))
    assert left[0] < 0.7
    assert left[-2] == pytest.approx(left[-1], rel=0.03)
    for rms, motion in zip(left, motions, strict=True):
        claimed = np.sqrt(np.mean(motion.covariance[300:, :, 0, 0]))
        assert claimed == pytest.approx(rms, rel=0.2)
    offline = smoothed(time_s, measured)
    np.testing.assert_array_equal(motions[-1].state, offline.state)
    apart = [
        np.abs(each.state[300:, :, 0] - offline.state[300:, :, 0]).mean() for each in motions[: len(DELAYS_S)]
    ]
    assert all(more < less for less, more in itertools.pairwise(apart))
    assert apart[-1] < 0.1 * apart[0]


def test_without_a_delay_it_is_a_filter_and_with_one_it_looks_no_further() -> None:
    time_s, _, measured, known = noisy(900, 3, 2)
    changed, at = measured.copy(), 700
    changed[at:] += 20.0
    for delay in DELAYS_S:
        [before], [after] = (delayed(time_s, each, known, [delay]) for each in (measured, changed))
        same = int(np.sum(last_seen(time_s, delay) < at))
        assert same == at - round(delay * RATE_HZ)
        np.testing.assert_array_equal(before.state[:same], after.state[:same])
        np.testing.assert_array_equal(before.covariance[:same], after.covariance[:same])
        assert not np.array_equal(before.state[same], after.state[same])


def test_frame_by_frame_is_as_the_whole_take() -> None:
    time_s, _, measured, known = noisy(3 * FIRST_KEPT, 4, 3)
    time_s = time_s + np.random.default_rng(3).uniform(0, 0.004, len(time_s))
    known[90:95, 2] = False
    [whole] = delayed(time_s, measured, known, [0.1])
    smoother, waiting = FixedLagSmoother(4), 0
    for frame, time in enumerate(time_s.tolist()):
        smoother.add(time, measured[frame], known[frame])
        ends = last_seen(time_s[: frame + 1], 0.1)
        # A frame can be estimated once one came that is too late for it.
        ready = int(np.searchsorted(ends, frame))
        for number in range(waiting, ready):
            one = smoother.estimates(np.array([number]), ends[number : number + 1])
            np.testing.assert_allclose(one.state[0], whole.state[number], rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(one.covariance[0], whole.covariance[number], rtol=1e-6, atol=1e-9)
            np.testing.assert_array_equal(one.is_measured[0], whole.is_measured[number])
        waiting = ready
        smoother.forget(waiting)
    assert waiting > len(time_s) - 15


def test_what_is_not_measured_stays_as_it_came_and_holes_are_bridged_within_the_delay() -> None:
    time_s, truth, measured, known = noisy(800, 2, 4, noise_deg=0.3)
    known[400:405, 0], known[600:700, 1] = False, False
    measured = np.where(known, measured, 77.0)
    [motion] = delayed(time_s, measured, known, [0.1])
    assert np.abs(motion.state[400:405, 0, 0] - truth[400:405, 0]).max() < 1.5
    assert motion.is_measured[400:405].all()
    alone = slice(600, 690)
    assert not motion.is_measured[alone, 1].any()
    np.testing.assert_array_equal(motion.state[alone, 1, 0], 77.0)
    assert np.abs(motion.state[700:, 1, 0] - truth[700:, 1]).max() < 1.5
    # Of the first frames too little is known of the noise to average them; after a pause nothing is.
    short = SHORTEST_RUN - 1
    for first in (0, 500):
        later = np.where(np.arange(len(time_s)) < first, time_s, time_s + 5.0)
        [motion] = delayed(later, measured, np.ones_like(known), [0.0])
        assert not motion.is_measured[first : first + short].any()
        np.testing.assert_array_equal(
            motion.state[first : first + short, :, 0], measured[first : first + short]
        )
        assert motion.is_measured[first + short : first + 100].all()
