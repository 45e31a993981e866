"""The slope of a context column: right on a line, blind to noise and unknown frames, and useful for a lag."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.base.slow_context_effect import SlopeState, slopes
from glovecal_models.effects.catalogue import catalogue

TIME = np.arange(0, 60, 0.04)


def test_the_slope_of_a_line_is_found_within_seconds():
    found = slopes(TIME, 40.0 + 0.05 * TIME)
    assert found[0] == 0.0
    np.testing.assert_allclose(found[TIME > 15], 0.05, rtol=0.25)
    assert found[-1] == pytest.approx(0.05, rel=0.05)


def test_noise_is_not_taken_for_a_slope():
    noise = np.random.default_rng(0).normal(0, 0.1, len(TIME))
    found = slopes(TIME, 40.0 + noise)
    assert np.abs(found).max() < 0.05
    assert np.abs(found[TIME > 10]).max() < 0.005


def test_unknown_frames_and_gaps_are_stepped_over():
    value = 40.0 + 0.05 * TIME
    value[:20] = value[600:700] = np.nan
    assert slopes(TIME, value)[-1] == pytest.approx(0.05, rel=0.05)
    later = np.where(TIME > 30, TIME + 5.0, TIME)
    fresh = slopes(later, value)[TIME > 30]
    np.testing.assert_allclose(fresh, slopes(TIME[TIME > 30], value[TIME > 30]), rtol=0, atol=1e-12)
    assert not slopes(TIME, np.full(len(TIME), np.nan)).any()


def test_frame_by_frame_is_the_same():
    value = 40.0 + np.sin(TIME / 9)
    value[100:120] = np.nan
    state, step = SlopeState(), np.diff(TIME, prepend=TIME[:1])
    live = [state.step(float(elapsed), float(each)) for elapsed, each in zip(step, value, strict=True)]
    np.testing.assert_allclose(live, slopes(TIME, value), rtol=0, atol=1e-12)


def test_a_sensor_that_follows_late_is_described():
    """What h - T dh/dt leaves after value and slope, against value alone."""
    humidity, generator, takes, felt = catalogue()["humidity"], np.random.default_rng(1), [], []
    for _ in range(8):
        slope, start = generator.normal(0, 0.02), generator.uniform(40, 50)
        takes.append(Signals(TIME, np.zeros((len(TIME), 1)), context={"humidity_pct": start + slope * TIME}))
        felt.append(start + slope * (TIME - 150.0))
    settings = humidity.fit_constants(takes)
    columns = np.concatenate([humidity.columns(take, settings, np.zeros((1, 0)))[:, 0] for take in takes])
    target = np.concatenate(felt) - np.mean(felt)

    def left(some: np.ndarray) -> float:
        some = np.column_stack([np.ones(len(some)), some])
        return float(np.var(target - some @ np.linalg.lstsq(some, target, rcond=None)[0]) / np.var(target))

    assert left(columns[:, :4]) > 3 * left(columns)
    assert humidity.weight_names(settings)[-1].endswith("[c.humidity_pct]_per_min")
