"""Hysteresis: plays are the same both ways, pulls differ each way, and neither knows of time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.hysteresis import PULL, Hysteresis

HYSTERESIS = Hysteresis()
SHAPE = np.array([[4.0]])


def moved(own_deg: np.ndarray) -> Signals:
    return Signals(np.arange(len(own_deg)) / 60, own_deg[:, None], {}, {}, "w1", "t1")


def swings(seed: int, count: int = 60) -> np.ndarray:
    """From one posture to the next, 20 frames each."""
    postures = np.random.default_rng(seed).uniform(0.0, 90.0, count)
    return np.interp(np.arange(20 * count) / 20, np.arange(count), postures)


def columns(own_deg: np.ndarray, constants: dict) -> np.ndarray:
    """(N, K)."""
    return HYSTERESIS.columns(moved(own_deg), constants, SHAPE)[:, 0]


def repairing() -> dict:
    return HYSTERESIS.further.constants(HYSTERESIS, [moved(swings(0))])


def left_of(error_deg: np.ndarray, inputs: np.ndarray) -> float:
    """The share of an error's RMS that a straight line over ``inputs`` leaves."""
    inputs = np.column_stack([np.ones(len(inputs)), inputs])
    left = error_deg - inputs @ np.linalg.lstsq(inputs, error_deg, rcond=None)[0]
    return float(left.std() / error_deg.std())


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("is_closing", [True, False])
def test_cloth_that_is_held_one_way_is_followed(seed, is_closing):
    """A brush seal: stretched over 10 degrees of one way, let go within one of the other."""
    own, error = swings(seed), np.zeros(1200)
    held, loose = (10.0, 1.0) if is_closing else (1.0, 10.0)
    for at in range(1, len(own)):
        moves = own[at] - own[at - 1]
        aim, length = (3.0, held) if moves > 0 else (0.0, loose)
        error[at] = aim + (error[at - 1] - aim) * np.exp(-abs(moves) / length)
    without = {key: value for key, value in repairing().items() if key != PULL}
    assert left_of(error, columns(own, repairing())) < 0.7 * left_of(error, columns(own, without))


@given(st.lists(st.floats(0.0, 90.0), min_size=2, max_size=8), st.integers(2, 30))
@settings(max_examples=50, deadline=None)
def test_only_the_path_counts_not_its_speed(turns, frames):
    """A way in one step, and in many."""
    slowly = np.interp(np.arange((len(turns) - 1) * frames + 1) / frames, np.arange(len(turns)), turns)
    constants = HYSTERESIS.fit_constants([moved(swings(0))])
    slow, fast = columns(slowly, constants)[::frames], columns(np.array(turns), constants)
    np.testing.assert_allclose(slow, fast, atol=1e-9)


def test_a_pull_is_whole_at_the_end_of_one_way_and_gone_at_the_end_of_the_other():
    names = HYSTERESIS.weights(repairing()).names
    there = columns(np.array([0.0, 90.0]), repairing())[-1]
    back = columns(np.array([0.0, 90.0, 0.0]), repairing())[-1]
    assert names[-2:] == ("pull_on_closing_deg_per_deg", "pull_on_opening_deg_per_deg")
    assert there[-2:] == pytest.approx([SHAPE.item(), 0.0], abs=0.01)
    assert back[-2:] == pytest.approx([0.0, SHAPE.item()], abs=0.01)


def test_a_model_stored_without_pulls_has_none():
    constants = HYSTERESIS.fit_constants([moved(swings(0))])
    before = {key: value for key, value in constants.items() if key != PULL}
    now, stored = columns(swings(1), constants), columns(swings(1), before)
    assert stored.shape[1] == len(HYSTERESIS.weights(before).names) == now.shape[1] - 2
    np.testing.assert_array_equal(stored, now[:, :-2])
