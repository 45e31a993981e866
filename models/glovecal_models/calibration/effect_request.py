"""An effect that a calibration is asked to have, and where."""

from __future__ import annotations

from dataclasses import dataclass, field

from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.facts import Settings


@dataclass(frozen=True)
class EffectRequest:
    """An effect and the rotations it is on."""

    effect: Effect
    rotations: tuple[str, ...]
    settings: Settings = field(default_factory=dict)
    """What is known already: the clocks' offsets."""

    @property
    def name(self) -> str:
        return self.effect.name

    @property
    def has_columns(self) -> bool:
        """It corrects the prediction; the others repair the measurement or widen the interval."""
        return self.effect.has_columns

    @property
    def is_on_reference(self) -> bool:
        """It repairs the measurement; nothing is predicted."""
        return self.effect.kind == "repair"
