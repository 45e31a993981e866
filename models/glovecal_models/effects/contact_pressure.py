"""Contact pressure: gripping something presses on the sensor beside bending it."""

from typing import ClassVar

from glovecal_models.effects.base.context_effect import ContextEffect
from glovecal_models.effects.base.facts import Control
from glovecal_models.effects.base.motions import ONE_FINGER


class ContactPressure(ContextEffect):
    name = "contact_pressure"
    explanation = "Pressing against an object changes the reading although the joint does not move."
    source = "offset and gain per newton"
    shown_by: ClassVar = ONE_FINGER
    context: ClassVar = ("contact_n",)
    control: ClassVar[Control] = "circularly shifted"
