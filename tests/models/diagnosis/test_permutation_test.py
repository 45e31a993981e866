"""What permuted columns explain of all joints at once is what each joint by itself would give."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_models.diagnosis.permutation_test import _Given, _Projected
from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.catalogue import stored_correction

FRAMES, TAKES, JOINTS = 60, 3, 2


def a_take(random: np.random.Generator, number: int) -> Signals:
    time_s = np.arange(FRAMES) / 20
    temperature = np.full(FRAMES, 20.0 + number) + 0.2 * random.standard_normal(FRAMES)
    own = 40 + 20 * random.standard_normal((FRAMES, JOINTS))
    return Signals(time_s, own, {}, {"temperature_c": temperature}, "first")


def a_joint(random: np.random.Generator, bases: int, missing: slice) -> _Projected:
    """Of all takes; ``missing`` rows of the second were not measured."""
    take, row = np.repeat(np.arange(TAKES), FRAMES), np.tile(np.arange(FRAMES), TAKES)
    kept = np.ones(len(take), dtype=bool)
    kept[FRAMES : 2 * FRAMES][missing] = False
    base = np.linalg.qr(random.standard_normal((int(kept.sum()), bases)))[0]
    target = random.standard_normal(len(base))
    return _Projected(base, target - base @ (base.T @ target), take[kept], row[kept])


@pytest.mark.parametrize("missing", [slice(0, 0), slice(10, 45), slice(0, FRAMES)])
def test_joints_that_were_measured_in_different_rows_are_explained_as_if_alone(missing: slice) -> None:
    random = np.random.default_rng(4)
    takes = [a_take(random, number) for number in range(TAKES)]
    joints = [a_joint(random, 2, slice(0, 0)), a_joint(random, 3, missing)]
    known = stored_correction("temperature", {})
    settings = known.fit_constants(takes)
    grid = known.shape.grid(takes, settings)
    givers = np.array([1, 2, 0])
    together = _Given(known, settings, grid, takes, joints).explained(givers)
    for lane, joint in enumerate(joints):
        alone = [Signals(each.time_s, each.own[:, [lane]], {}, each.context, each.wearing) for each in takes]
        own = {
            name: [value[lane]] if isinstance(value, list) and len(value) == JOINTS else value
            for name, value in settings.items()
        }
        found = _Given(known, own, grid[:, [lane]], alone, [joint]).explained(givers)
        assert found[0] == pytest.approx(together[lane], rel=1e-9)
