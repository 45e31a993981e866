"""Temperature: offset and gain change with the temperature of glove and hand."""

from typing import ClassVar

from glovecal_models.effects.base.context_effect import ContextEffect
from glovecal_models.effects.base.facts import Rival
from glovecal_models.effects.base.motions import CROSSED


class Temperature(ContextEffect):
    name = "temperature"
    explanation = "The reading changes with the temperature of glove and hand."
    source = "linear temperature coefficients of offset and gain, deg/K"
    shown_by: ClassVar = CROSSED
    rivals: ClassVar = tuple(Rival(name, CROSSED) for name in ("humidity", "supply_sag"))
    context: ClassVar = ("temperature_c",)
