"""Temperature: offset and gain change with the temperature of glove and hand, which may be minutes late."""

from typing import ClassVar

from glovecal_models.effects.base.facts import Rival
from glovecal_models.effects.base.motions import CROSSED
from glovecal_models.effects.base.slow_context_effect import SlowContextEffect


class Temperature(SlowContextEffect):
    name = "temperature"
    explanation = "The reading changes with the temperature of glove and hand."
    source = "linear temperature coefficients of offset and gain, deg/K; cloth follows within minutes"
    shown_by: ClassVar = CROSSED
    rivals: ClassVar = tuple(Rival(name, CROSSED) for name in ("humidity", "supply_sag"))
    context: ClassVar = ("temperature_c",)

    @property
    def needs_movement(self) -> bool:
        """Single poses show how the reading goes with the temperature, if not how late."""
        return False
