"""An effect in a request: a name, or a user's own as a text, read and held against what was recorded."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

from pydantic import Field

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training_settings import declaration_of
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.catalogue import DeclaredEffect, declared_effect, effect_of_declaration
from glovecal_models.effects.catalogue import effect as known_effect
from glovecal_service.request_types import EffectName, StrictBody
from glovecal_service.store.records import TakeRecord

LONGEST_TEXT = 2000


class Declared(StrictBody):
    declaration: Annotated[str, Field(min_length=1, max_length=LONGEST_TEXT)] = Field(
        description="Such as `name = strap; columns = c.strap_n * own; unit = deg`."
    )


AskedEffect = Annotated[
    EffectName | Declared, Field(description="A name of the catalogue, or your own effect as a text.")
]


def asked_effect(
    asked: EffectName | Declared, model: CalibrationModel, takes: Sequence[TakeRecord]
) -> Effect:
    """A name is looked up among the model's own declared effects first. Raises BadInput."""
    if isinstance(asked, Declared):
        return checked_declaration(asked.declaration, takes, model.layout.sensors)
    own = declaration_of(model, asked)
    return known_effect(asked) if own is None else effect_of_declaration(own)


def checked_declaration(text: str, takes: Sequence[TakeRecord], sensors: Sequence[str]) -> DeclaredEffect:
    """The effect. Raises BadInput: cannot be read, name taken, or a column that no take recorded."""
    effect = declared_effect(text)
    effect.declaration.check_signals(set(sensors), {name for take in takes for name in take.context})
    return effect


def declaration_document(effect: DeclaredEffect) -> dict[str, Any]:
    """As jobs and models keep it."""
    return effect.declaration.to_document()
