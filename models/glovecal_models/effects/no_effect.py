"""No effect: the calibration as it is, as an object that answers like every other."""

from __future__ import annotations

from typing import ClassVar

from glovecal_models.effects.base.effect import ColumnlessEffect
from glovecal_models.effects.base.facts import Kind, Stage


class NoEffect(ColumnlessEffect):
    name = "no_effect"
    explanation = "Nothing is missing: what remains is noise."
    source = "the null hypothesis"
    kind: ClassVar[Kind] = "nothing"
    stage: ClassVar[Stage] = "never"
