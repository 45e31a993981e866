"""Effects that stay in a model as a wider interval: no correction brings back what the sensor does not say.

How wide is learned from errors on held-out takes of training, never from the fit's own residuals: those of a
flexible base are too small.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from glovecal_models.effects.base.facts import Kind, Settings
from glovecal_models.effects.base.signature_effect import SignatureEffect


@dataclass(frozen=True)
class ClaimedErrors:
    """The n measured frames of one rotation in one take; the calibration that predicted them never saw it."""

    take: str
    rotation: str
    since_start_s: np.ndarray
    """(n,), since the first frame of the take."""
    error: np.ndarray
    """(n,), predicted minus measured, degrees."""
    measured: np.ndarray
    """(n,), degrees."""
    variance: np.ndarray
    """(n,), claimed, measurement noise included, degrees squared."""
    noise: float
    """The share of measurement noise in ``variance``, degrees squared."""
    sensors: tuple[str, ...]
    readings: np.ndarray
    """(n, S), raw counts."""


class Interval(ABC):
    """What an effect's settings mean for the claimed variance of L rotations."""

    @abstractmethod
    def added_variance(self, since_start_s: np.ndarray, readings: np.ndarray) -> np.ndarray:
        """(N, L) degrees squared beside the claimed variance, from readings (N, S).

        Negative, but never below minus the measurement noise, where the effect explains what training took
        for noise. ``since_start_s`` (N,) counts from the first frame of a run or wearing.
        """


class IntervalEffect(SignatureEffect):
    """Implement what is learned, and the variance that follows from it."""

    kind: ClassVar[Kind] = "interval"
    shows_later: ClassVar[bool] = False
    """Whether it grows beyond what takes of usual length show: it stays if the claim on them is no worse."""

    @abstractmethod
    def learned(self, held_out: Sequence[ClaimedErrors], found: Settings) -> Settings:
        """Constants for the rotations of ``held_out``; ``found`` are those that the takes themselves gave."""

    @abstractmethod
    def interval(
        self, settings: Settings, rotations: Sequence[str], sensors: Sequence[str], noise: np.ndarray
    ) -> Interval:
        """For L ``rotations`` whose measurement noise has the variance ``noise`` (L,), degrees squared."""

    def widens(self, settings: Settings, rotations: Sequence[str]) -> bool:
        """Whether it found anything that makes any of ``rotations`` less sure."""
        return True

    @abstractmethod
    def sentence(self, settings: Settings, rotations: Sequence[str]) -> str:
        """What the claimed standard deviation of ``rotations`` does, without a full stop."""

    @abstractmethod
    def described_on(self, settings: Settings, rotation: str) -> dict[str, float]:
        """The learned numbers of one rotation, units in their names."""
