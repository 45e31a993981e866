"""A user's own effect in a request: its text read and held against what was recorded, before any job."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

from pydantic import Field

from glovecal_models.effects.catalogue import DeclaredEffect, declared_effect
from glovecal_service.rest.http.request_types import StrictBody
from glovecal_service.store.records import TakeRecord

LONGEST_TEXT = 2000


class Declared(StrictBody):
    declaration: Annotated[str, Field(min_length=1, max_length=LONGEST_TEXT)] = Field(
        description="Such as `name = strap; columns = c.strap_n * own; unit = deg`."
    )


def checked_declaration(text: str, takes: Sequence[TakeRecord], sensors: Sequence[str]) -> DeclaredEffect:
    """The effect. Raises BadInput: cannot be read, name taken, or a column that no take recorded."""
    effect = declared_effect(text)
    effect.declaration.check_signals(set(sensors), {name for take in takes for name in take.context})
    return effect


def declaration_document(effect: DeclaredEffect) -> dict[str, Any]:
    """As jobs and models keep it."""
    return effect.declaration.to_document()
