"""Humidity: sweat and moist air change the sensors' resistance."""

from typing import ClassVar

from glovecal_models.effects.context_effect import ContextEffect


class Humidity(ContextEffect):
    name = "humidity"
    explanation = "The reading changes with the humidity inside the glove."
    source = "linear coefficients of offset and gain, deg/%"
    context: ClassVar = ("humidity_pct",)
