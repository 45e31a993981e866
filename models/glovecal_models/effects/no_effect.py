"""No effect: the calibration as it is, as an object of a name like every other."""

from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.facts import About


class NoEffect(Effect):
    name = "no_effect"
    about = About("Nothing is missing: what remains is noise.", source="the null hypothesis")
