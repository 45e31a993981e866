"""Fits that were done before are handed back; what memory has no room for is done again."""

from __future__ import annotations

import numpy as np

from glovecal_models.calibration.effect_fit import FitMemory
from glovecal_models.calibration.fit_task import FitTask
from glovecal_models.calibration.model import restore_regressor
from glovecal_models.calibration.training_settings import TrainingSettings


def _task(slope: float) -> FitTask:
    random = np.random.default_rng(1)
    inputs = random.integers(20, 230, (120, 1)).astype(float)
    target = slope * inputs[:, 0] + 4 * np.sin(inputs[:, 0] / 40) + random.standard_normal(120)
    nothing = np.empty((0, 1)), np.empty(0)
    place = np.arange(120) // 40, np.arange(120)
    return FitTask("I_MCP", None, inputs, target, *place, *nothing, ("I_MCP",), TrainingSettings())


def test_the_same_samples_are_fitted_once() -> None:
    memory = FitMemory()
    [first] = memory.fit([_task(0.3)])
    again, other = memory.fit([_task(0.3), _task(0.4)])
    assert again is first
    assert other is not first


def test_the_longest_unused_fit_is_forgotten() -> None:
    memory = FitMemory(most_bytes=0)
    [first] = memory.fit([_task(0.3)])
    [again] = memory.fit([_task(0.3)])
    assert again is not first
    for name, array in first.arrays.items():
        np.testing.assert_array_equal(array, again.arrays[name])


def test_the_mean_alone_is_that_of_the_prediction() -> None:
    [fit] = FitMemory().fit([_task(0.3)])
    regressor = restore_regressor(fit.arrays, fit.settings)
    inputs = np.linspace(10.0, 240.0, 5000)[:, None]
    np.testing.assert_allclose(regressor.mean(inputs), regressor.predict(inputs).mean, rtol=0, atol=1e-12)
    assert regressor.mean(inputs[:0]).shape == (0,)
