"""Residuals with something known in them, made without a model."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import lfilter

from glovecal_models.comparison.residuals import Residuals, TakeResiduals
from glovecal_models.takes.take import Take

RATE_HZ = 60.0
Series = Callable[..., np.ndarray]


@pytest.fixture
def slow() -> Series:
    """Noise of standard deviation 1 whose neighbours are alike over ``seconds``."""

    def make(generator: np.random.Generator, count: int, seconds: float) -> np.ndarray:
        memory = np.exp(-1 / (seconds * RATE_HZ))
        return np.sqrt(1 - memory**2) * lfilter([1], [1, -memory], generator.normal(size=count + 600))[600:]

    return make


@pytest.fixture
def take_residuals() -> Callable[..., TakeResiduals]:
    """A take of one rotation "A" and two sensors "A" and "B" from its angle, error and second sensor.

    Both sensors read the error too: no map of them is better than that.
    """

    def make(
        angle: np.ndarray, error: np.ndarray, other: np.ndarray, name: str = "one", wearing: str = "monday",
        context: dict[str, np.ndarray] | None = None, poses: tuple[str, ...] | None = None,
    ) -> TakeResiduals:  # fmt: skip
        time = np.arange(len(angle)) / RATE_HZ
        readings = np.column_stack([100 + np.nan_to_num(angle + error), 100 + np.nan_to_num(other + error)])
        take = Take(
            name=name, wearing=wearing, sensors=("A", "B"), time_s=time, readings=readings, rotations=("A",),
            reference_time_s=time, reference=angle[:, None], context=context or {}, poses=poses,
        )  # fmt: skip
        return TakeResiduals(take, (angle + error)[:, None], np.ones((len(angle), 1)), angle[:, None])

    return make


@pytest.fixture
def together() -> Callable[..., Residuals]:
    def make(*takes: TakeResiduals) -> Residuals:
        return Residuals(("A",), takes)

    return make


@pytest.fixture
def holds() -> Callable[[int], np.ndarray]:
    """An angle that rests many times, moving in between."""

    def make(count: int, seconds: float = 1.5) -> np.ndarray:
        levels = np.random.default_rng(7).uniform(0, 80, count)
        parts = []
        for before, after in zip(levels, np.roll(levels, -1), strict=True):
            parts += [np.full(int(RATE_HZ * seconds), before), np.linspace(before, after, 30)]
        return np.concatenate(parts)

    return make
