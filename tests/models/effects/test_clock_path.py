"""A clock that changes within takes: a joint's offset is that of the others; sound clocks have none."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_models.effects.delay.delay_grid import DelayErrors, DelayForm
from glovecal_models.effects.delay.delay_verdict import cells_of_others, clock_choice, possible_delays

DELAYS_S = np.round(np.arange(-0.1, 0.1001, 0.005), 3)
BLOCKS, JOINTS = 24, 4
TAKE = np.repeat([0, 1, 2], 8)
PATH_S = np.tile([0.06, 0.045, 0.03, 0.015, 0.0, 0.0, 0.0, 0.0], 3)


def grids(true_s: np.ndarray, seed: int = 0) -> list[DelayErrors]:
    """Errors that rise with the square of the distance from the true delay (B,), and noise."""
    generator = np.random.default_rng(seed)
    found = []
    for _ in range(JOINTS):
        speed = generator.uniform(0.5, 1.5, BLOCKS)[:, None] * 4e4
        away = (DELAYS_S[None, :] - true_s[:, None]) ** 2
        blocks = 60.0 + speed * away + generator.normal(0, 1.0, away.shape)
        form = np.full(len(DELAYS_S), DelayForm.PURE)
        zero = int(np.argmin(np.abs(DELAYS_S)))
        found.append(
            DelayErrors(form, DELAYS_S, blocks, blocks[:, zero], TAKE, np.ones(BLOCKS), 125 * BLOCKS)
        )
    return found


def test_the_path_of_a_joint_is_that_of_the_others():
    cells = cells_of_others(grids(PATH_S))
    assert cells is not None
    for cell in cells:
        assert np.abs(DELAYS_S[cell] - PATH_S).max() <= 0.0101


@pytest.mark.parametrize("constant_s", [0.0, 0.03, -0.05])
def test_a_constant_offset_has_no_path(constant_s):
    assert clock_choice(grids(np.full(BLOCKS, constant_s))).within is None


def test_a_clock_that_is_pulled_in_is_a_clock_whatever_delay_it_resembles():
    some = grids(PATH_S)
    choice = clock_choice(some)
    assert choice.within is not None
    true, mirrored = choice.errors(some)
    assert sum(map(np.sum, true)) < 0.7 * sum(map(np.sum, mirrored))
    assert possible_delays(some) == ("clock_offset",)


def test_few_joints_or_other_blocks_tell_no_path():
    some = grids(PATH_S)
    assert cells_of_others(some[:2]) is None
    other = DelayErrors(
        some[0].form, DELAYS_S, some[0].blocks, some[0].unmoved, TAKE[::-1].copy(), some[0].fast, some[0].rows
    )
    assert cells_of_others([other, *some[1:]]) is None
