"""Humidity: sweat and moist air change the sensors; the fabric takes moisture up within minutes."""

from typing import ClassVar

from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.facts import EffectFacts, Rival, Settings
from glovecal_models.effects.base.motions import CROSSED
from glovecal_models.effects.base.slow_context_effect import START, SlowContextEffect
from glovecal_models.effects.base.stored_slope_effect import StoredSlopeEffect


class _HumidityFacts(EffectFacts):
    name = "humidity"
    explanation = "The reading changes with the humidity inside the glove."
    source = "linear coefficients of offset and gain, deg/%; follows within minutes"
    shown_by: ClassVar = CROSSED
    rivals: ClassVar = (Rival("supply_sag", CROSSED),)
    context: ClassVar = ("humidity_pct",)


class Humidity(_HumidityFacts, SlowContextEffect):
    def as_stored(self, settings: Settings) -> Effect:
        return self if START in settings else _StoredHumidity()


class _StoredHumidity(_HumidityFacts, StoredSlopeEffect):
    """Of models stored before the slope at a take's start was estimated."""
