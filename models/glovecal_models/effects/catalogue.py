"""The catalogue: every effect that is known by name, found by the entry-point group ``glovecal.effects``.

A package of one's own adds an effect by an entry point that names its class; nothing here changes.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib.metadata import entry_points
from typing import Any

from glovecal_models.effects.base.effect import Effect, Settings
from glovecal_models.effects.context_dependence import PREFIX, ContextDependence
from glovecal_models.effects.declared.expression_effect import ExpressionEffect
from glovecal_models.errors import BadInput

GROUP = "glovecal.effects"


@cache
def catalogue() -> dict[str, Effect]:
    """Every effect by its name. Raises BadInput for an entry point that is none."""
    found: dict[str, Effect] = {}
    for point in sorted(entry_points(group=GROUP), key=lambda item: item.name):
        effect = point.load()()
        if not isinstance(effect, Effect) or effect.name != point.name:
            raise BadInput(
                f"entry point {point.value} of {GROUP} is not an effect of the name {point.name!r}"
            )
        if point.name in found:
            raise BadInput(f"two packages bring an effect of the name {point.name!r}")
        found[point.name] = effect
    return found


def effect(name: str) -> Effect:
    """One effect by its name. Raises BadInput that lists those there are."""
    known = catalogue()
    if name.startswith(PREFIX) and len(name) > len(PREFIX):
        return ContextDependence(name.removeprefix(PREFIX))
    if name not in known:
        raise BadInput(f"no effect {name!r}; there are {', '.join(known)}")
    return known[name]


def declared_effect(declaration: str | Mapping[str, Any]) -> ExpressionEffect:
    """A user's new effect from its line of text or JSON document. Raises BadInput, also for a taken name."""
    if isinstance(declaration, str):
        declared = ExpressionEffect.parse(declaration)
    else:
        declared = ExpressionEffect.from_document(declaration)
    if declared.name in catalogue():
        raise BadInput(f"there is an effect {declared.name!r} already; give yours another name")
    declared.check_sizes()
    return declared


def stored_effect(name: str, settings: Settings) -> Effect:
    """The effect of a stored model, declared ones included. Raises BadInput."""
    if "declaration" in settings:
        return ExpressionEffect.from_document(settings["declaration"])
    return effect(name)
