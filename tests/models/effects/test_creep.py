"""Creep: its relaxations reach from a lag's end to a take's length, and stored models keep theirs."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.creep import BESIDE, FASTEST_S, SLOWEST_SD, Creep

CREEP = Creep()
SHAPE = np.array([[0.5, 2.0, 8.0]])
"""8 s / 64 would be a relaxation of 0.125 s."""


def stepped() -> Signals:
    """A joint that is bent by 40 degrees after 5 s, at 50 Hz."""
    time = np.arange(0.0, 20.0, 0.02)
    own = np.where(time < 5.0, 0.0, 40.0)[:, None]
    return Signals(time, own, {}, {}, "w1", "t1")


def column(settings: dict, name: str) -> np.ndarray:
    columns = CREEP.columns(stepped(), settings, SHAPE)
    return columns[:, 0, CREEP.weights(settings).names.index(name)]


def time_constant_s(settings: dict) -> float:
    """Of the fastest further relaxation, from the frame after the step on, when it is e times smaller."""
    away = np.abs(column(settings, f"share_of_{BESIDE[1]:.3g}_slow_deg_per_deg")[250:])
    return float(np.argmax(away < away[0] / np.e) * 0.02)


def test_creep_learns_no_relaxation_as_fast_as_a_lag():
    assert time_constant_s(CREEP.further.constants(CREEP, [stepped()])) == pytest.approx(FASTEST_S, abs=0.03)


def test_a_model_stored_before_relaxes_as_it_did():
    settings = {
        key: value for key, value in CREEP.further.constants(CREEP, [stepped()]).items() if key != "fastest_s"
    }
    assert time_constant_s(settings) == pytest.approx(8.0 / 64, abs=0.03)


def test_what_is_slower_than_a_take_is_expected_small_and_nothing_else():
    settings = CREEP.further.constants(CREEP, [stepped()])
    names, prior = CREEP.weights(settings).names, CREEP.weights(settings).prior_sd
    assert len(names) == len(prior) == CREEP.columns(stepped(), settings, SHAPE).shape[2]
    small = {name for name, sd in zip(names, prior, strict=True) if sd == SLOWEST_SD}
    assert small == {"share_of_4_slow_deg_per_deg", "start_of_4_slow_deg_per_deg"}
    assert CREEP.weights(CREEP.fit_constants([stepped()])).prior_sd.tolist() == [1.0] * 6
