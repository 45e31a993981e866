"""An effect that a calibration model holds: on which rotations, with which shape and weights."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.facts import Settings
from glovecal_models.effects.base.interval_effect import IntervalEffect
from glovecal_models.effects.catalogue import stored_effect
from glovecal_models.errors import BadInput


@dataclass(frozen=True)
class AddedEffect:
    """Immutable. The correction is columns x weights, added to the base's prediction."""

    name: str
    rotations: tuple[str, ...]
    """The L lanes."""
    settings: Settings
    shape: np.ndarray
    """(L, P)."""
    weights: np.ndarray
    """(L, C); no columns for an effect that repairs the reference."""
    zero_deg: np.ndarray
    """(L,): the base's prediction at a raw reading of zero, by a straight line."""
    evidence: Mapping[str, Any] = field(default_factory=dict)
    """What it saved, beside its decoy, when it was added; plain JSON-able data."""

    def __post_init__(self) -> None:
        lanes = len(self.rotations)
        if self.shape.ndim != 2 or len(self.shape) != lanes or self.weights.ndim != 2:
            raise BadInput(f"effect {self.name!r}: shape {self.shape.shape} for {lanes} rotations")
        if len(self.weights) != lanes or self.zero_deg.shape != (lanes,):
            raise BadInput(f"effect {self.name!r}: weights {self.weights.shape} for {lanes} rotations")

    @property
    def effect(self) -> Effect:
        """From the catalogue. Raises BadInput when this machine does not have it."""
        return stored_effect(self.name, self.settings)

    @property
    def active(self) -> tuple[str, ...]:
        """Rotations on which it has weight."""
        if not self.weights.shape[1]:
            return self.rotations
        return tuple(
            name for name, weights in zip(self.rotations, self.weights, strict=True) if np.any(weights)
        )

    def described(self) -> dict[str, dict[str, float]]:
        """For each rotation the learned numbers, units in their names."""
        effect = self.effect
        if isinstance(effect, IntervalEffect):
            return {name: effect.described_on(self.settings, name) for name in self.rotations}
        return {
            name: effect.described(self.settings, shape, weights)
            for name, shape, weights in zip(self.rotations, self.shape, self.weights, strict=True)
            if name in self.active
        }
