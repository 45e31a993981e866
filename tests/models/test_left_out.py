"""A stretch of a take that a person left out: nothing learns from it, and a memory meets a pause."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.effects.base.effect import CorrectionEffect
from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.catalogue import catalogue
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take
from glovecal_models.takes.take_check import check_take, excluded_sentences

HZ = 50.0
LAYOUT = Layout.from_columns("one", ("I_PIP",), ("I_PIP",))


def moving(seconds: float = 24.0, *, began_s: float = 0.0, own_clock: bool = False) -> Take:
    time = began_s + np.arange(round(seconds * HZ)) / HZ
    at = time if not own_clock else began_s + np.arange(round(seconds * 30.0)) / 30.0 + 0.003

    def angle(when: np.ndarray) -> np.ndarray:
        return 45.0 + 40.0 * np.sin(1.3 * (when - began_s))

    return Take(
        "bending", "w1", ("I_PIP",), time, np.round(400.0 + 5.0 * angle(time))[:, None], ("I_PIP",), at,
        angle(at)[:, None], context={"supply_v": np.full(len(time), 4.9)},
        poses=tuple("fist" if value > 60 else "" for value in angle(time)),
    )  # fmt: skip


@pytest.mark.parametrize("own_clock", [False, True])
def test_frames_and_reference_rows_between_two_times_are_gone(own_clock: bool) -> None:
    take = moving(began_s=1000.0, own_clock=own_clock)
    left = take.without([(5.0, 8.0), (20.0, 30.0)])
    for time in (left.time_s, left.reference_time_s):
        assert not (((time >= 1005.0) & (time <= 1008.0)) | (time >= 1020.0)).any()
    assert len(left.time_s) == len(left.readings) == len(left.context["supply_v"]) == len(left.poses or ())
    angles = left.reference_at_frames(["I_PIP"])[:, 0]
    everywhere = take.reference_at_frames(["I_PIP"])[np.isin(take.time_s, left.time_s), 0]
    assert np.array_equal(angles, everywhere, equal_nan=True) or own_clock
    known = np.isfinite(angles)
    assert np.array_equal(angles[known], everywhere[known])
    assert left.left_out_since_start == ((5.0, 8.0), (20.0, 30.0))
    assert len(take.time_s) == 24 * HZ, "the take itself stays"


def test_what_was_left_out_is_no_gap_and_is_said() -> None:
    take = moving(began_s=50.0)
    left = take.without([(0.0, 2.0), (5.0, 8.0)])
    assert check_take(left).gaps == 0
    assert check_take(left).longest_interval_s == pytest.approx(1 / HZ)
    lost = left.some(np.abs(left.time_s - 65.0) > 0.2, np.ones(len(left.reference_time_s), bool))
    assert check_take(lost).gaps == 1
    [sentence] = excluded_sentences([take, left])
    assert sentence == "Take 'bending': left out by hand: 0.00 to 2.00 s, 5.00 to 8.00 s."


def test_training_does_not_see_what_was_left_out() -> None:
    take = moving()
    spoiled = take.reference.copy()
    wrong = (take.time_s >= 5.0) & (take.time_s <= 8.0)
    spoiled[wrong] = 90.0 - spoiled[wrong]
    bad = Take(
        take.name,
        take.wearing,
        take.sensors,
        take.time_s,
        take.readings,
        take.rotations,
        take.time_s,
        spoiled,
    )
    settings = TrainingSettings(method="linear", folds=0)

    def error(learned: Take) -> float:
        model = train([learned], LAYOUT, "anna", settings)
        angles = model.rotations[0].regressor.mean(take.readings)
        return float(np.sqrt(np.mean((angles - take.reference[:, 0]) ** 2)))

    assert error(bad) > 5.0
    assert error(bad.without([(5.0, 8.0)])) < 0.5


def columns(name: str, take: Take) -> np.ndarray:
    """(N, C) of an effect of the catalogue over a take whose joint is read from its readings."""
    effect = catalogue()[name]
    assert isinstance(effect, CorrectionEffect)

    def signals(take: Take) -> Signals:
        return Signals(take.time_s, (take.readings - 400.0) / 5.0, context=take.context, wearing=take.wearing)

    settings = effect.fit_constants([signals(moving())])
    shape = effect.shape.grid([signals(moving())], settings)[-1]
    return effect.columns(signals(take), settings, shape)[:, 0]


@pytest.mark.parametrize("name", ["hysteresis", "creep", "lag"])
def test_to_an_effect_with_a_memory_it_is_a_pause_and_no_jump(name: str) -> None:
    """What was before the hole does not matter after it, and nothing leaps from its one side to the other."""
    take = moving()
    left = take.without([(5.0, 8.2)])
    after = left.time_s > 8.0
    alone = left.some(after, left.reference_time_s > 8.0)
    found = columns(name, left)[after]
    np.testing.assert_allclose(found, columns(name, alone), rtol=0, atol=1e-12)
    closed = replace(left, time_s=np.where(after, left.time_s - 3.2, left.time_s))
    jumped = columns(name, replace(closed, reference_time_s=closed.time_s))[after]
    assert np.abs(found - jumped).max() > 1e-3, "a joint that leaps would have been remembered"
