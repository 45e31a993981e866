"""Temperature: offset and gain change with the temperature of glove and hand."""

from typing import ClassVar

from glovecal_models.effects.base.context_effect import ContextEffect


class Temperature(ContextEffect):
    name = "temperature"
    explanation = "The reading changes with the temperature of glove and hand."
    source = "linear temperature coefficients of offset and gain, deg/K"
    context: ClassVar = ("temperature_c",)
