"""How far a sensor is behind a context column: right on a line, blind to noise, useful for a late sensor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.effects.base.context_effect import FOLLOWS_S, ColumnStart, FollowedColumn, mean_slopes
from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.catalogue import stored_correction

TIME = np.arange(0, 60, 0.04)
USUAL = ColumnStart(noise=4e-4, slope=0.01, slope_sd=0.05, curvature_sd=2e-4)
SLOW = ("humidity", "temperature")


def test_the_slope_of_a_line_is_found_within_seconds():
    found = mean_slopes(TIME, 40.0 + 0.05 * TIME, USUAL)
    assert found[0] == pytest.approx(USUAL.slope)
    np.testing.assert_allclose(found[TIME > 5], 0.05, rtol=0.05)


def test_noise_is_not_taken_for_a_slope():
    noise = np.random.default_rng(0).normal(0, 0.1, len(TIME))
    found = mean_slopes(TIME, 40.0 + noise, replace(USUAL, slope=0.0))
    assert np.abs(found).max() < 0.05
    assert np.std(found[TIME > 10]) < 0.005


def test_after_minutes_it_is_the_mean_of_the_past_however_the_take_began():
    time = np.arange(0, 12 * FOLLOWS_S, 0.5)
    value = 20.0 + np.sin(time / 100.0)
    followed = np.empty(len(time))
    state = value[0] - 5.0
    for at, now in enumerate(value):
        state += -np.expm1(-(0.5 if at else 0.0) / FOLLOWS_S) * (now - state)
        followed[at] = state
    late = time > 10 * FOLLOWS_S
    expected = (value - followed) / FOLLOWS_S
    np.testing.assert_allclose(mean_slopes(time, value, USUAL)[late], expected[late], rtol=0, atol=1e-5)


def test_what_takes_usually_begin_with_is_learned():
    generator, takes = np.random.default_rng(2), []
    for slope in generator.normal(0.02, 0.01, 60):
        takes.append((TIME, 40.0 + slope * TIME + generator.normal(0, 0.1, len(TIME))))
    found = ColumnStart.of_takes(takes)
    assert found.slope == pytest.approx(0.02, abs=0.004)
    assert found.slope_sd == pytest.approx(0.01, rel=0.3)
    assert found.noise == pytest.approx(0.1**2 * 0.04, rel=0.1)
    brief = [(time[:10], value[:10]) for time, value in takes]
    assert ColumnStart.of_takes(brief).slope == 0.0


def test_unknown_frames_and_gaps_are_stepped_over():
    value = 40.0 + 0.05 * TIME
    value[:20] = value[600:700] = np.nan
    assert mean_slopes(TIME, value, USUAL)[-1] == pytest.approx(0.05, rel=0.05)
    later = np.where(TIME > 30, TIME + 5.0, TIME)
    fresh = mean_slopes(later, value, USUAL)[TIME > 30]
    alone = mean_slopes(TIME[TIME > 30], value[TIME > 30], USUAL)
    np.testing.assert_allclose(fresh, alone, rtol=0, atol=1e-12)
    assert (mean_slopes(TIME, np.full(len(TIME), np.nan), USUAL) == USUAL.slope).all()


def test_frame_by_frame_and_in_pieces_is_the_same():
    value = 40.0 + np.sin(TIME / 9)
    value[:3] = value[100:120] = np.nan
    elapsed, whole = np.diff(TIME, prepend=TIME[:1]), mean_slopes(TIME, value, USUAL)
    for size in (1, 7):
        state = FollowedColumn(USUAL)
        pieces = [slice(first, first + size) for first in range(0, len(TIME), size)]
        live = np.concatenate([state.run(elapsed[piece], value[piece]) for piece in pieces])
        np.testing.assert_allclose(live, whole, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", SLOW)
def test_a_sensor_that_follows_late_is_described(name: str):
    """What h - T dh/dt leaves after value and slope, against value alone."""
    effect, generator, takes, felt = stored_correction(name, {}), np.random.default_rng(1), [], []
    for _ in range(8):
        slope, start = generator.normal(0, 0.02), generator.uniform(40, 50)
        column = start + slope * TIME + generator.normal(0, 0.05, len(TIME))
        takes.append(Signals(TIME, np.zeros((len(TIME), 1)), context={effect.context[0]: column}))
        felt.append(start + slope * (TIME - 150.0))
    settings = effect.fit_constants(takes)
    columns = np.concatenate([effect.columns(take, settings, np.zeros((1, 0)))[:, 0] for take in takes])
    target = np.concatenate(felt) - np.mean(felt)

    def left(some: np.ndarray) -> float:
        some = np.column_stack([np.ones(len(some)), some])
        return float(np.var(target - some @ np.linalg.lstsq(some, target, rcond=None)[0]) / np.var(target))

    assert left(columns[:, :4]) > 5 * left(columns)
    assert effect.weights(settings).names[-1].endswith(f"[c.{effect.context[0]}]_per_min")
