"""Humidity: sweat and moist air change the sensors; the fabric takes moisture up within minutes."""

from typing import ClassVar

from glovecal_models.effects.base.facts import Rival
from glovecal_models.effects.base.motions import CROSSED
from glovecal_models.effects.base.slow_context_effect import SlowContextEffect


class Humidity(SlowContextEffect):
    name = "humidity"
    explanation = "The reading changes with the humidity inside the glove."
    source = "linear coefficients of offset and gain, deg/%; follows within minutes"
    shown_by: ClassVar = CROSSED
    rivals: ClassVar = (Rival("supply_sag", CROSSED),)
    context: ClassVar = ("humidity_pct",)
