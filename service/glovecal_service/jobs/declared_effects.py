"""The effect that a job's payload declares."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.catalogue import effect_of_declaration


def declared(document: Mapping[str, Any] | None) -> list[Effect]:
    """The effect of a declaration as a list of one, or of none."""
    return [] if document is None else [effect_of_declaration(document)]
