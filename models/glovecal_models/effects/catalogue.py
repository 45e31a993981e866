"""The catalogue: every effect that is known by name, found by the entry-point group ``glovecal.effects``.

A package of one's own adds an effect by an entry point that names its class; nothing here changes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from importlib.metadata import entry_points
from typing import Any

from glovecal_models.effects.base.effect import CorrectionEffect, Effect
from glovecal_models.effects.base.relations import Relations
from glovecal_models.effects.base.signals import Settings, Signals
from glovecal_models.effects.base.wearing_effect import WearingEffect
from glovecal_models.effects.between import TABLE
from glovecal_models.effects.column_dependence import (
    COLUMN,
    CONTEXT,
    ColumnDependence,
    ContextDependence,
    unfamiliar_columns,
)
from glovecal_models.effects.declared.expression_effect import ExpressionEffect
from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean

GROUP = "glovecal.effects"
DeclaredEffect = ExpressionEffect
"""A user's own effect, declared in one line of text."""


def catalogue() -> dict[str, Effect]:
    """Every effect by its name. Raises BadInput for an entry point that is none."""
    return dict(registered_effects())


@cache
def registered_effects() -> dict[str, Effect]:
    """Those that packages bring, to which a process may add."""
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
    check_relations(found)
    return found


def relations() -> Relations:
    """What stands between effects, with the rows that packages bring."""
    return _relations(registered_effects())


def check_relations(known: Mapping[str, Effect]) -> None:
    """Raise BadInput for a row between effects that names none of ``known``, and for one that is there
    twice."""
    _relations(known).check(known)


def _relations(known: Mapping[str, Effect]) -> Relations:
    return TABLE.joined(item.about.relations for item in known.values())


def effect(name: str) -> Effect:
    """One effect by its name. Raises BadInput that lists those there are."""
    known = catalogue()
    for prefix, of_column in ((CONTEXT, ContextDependence), (COLUMN, ColumnDependence)):
        if name.startswith(prefix) and len(name) > len(prefix):
            return of_column(name.removeprefix(prefix))
    if name not in known:
        raise BadInput(f"no effect {name!r}; {did_you_mean(name, known)}")
    return known[name]


def candidates(takes: Sequence[Signals], own: Sequence[Effect] = ()) -> list[Effect]:
    """The catalogue, a user's ``own`` effects, and a smooth curve of each recorded context column that none
    of them asks for."""
    known = [*catalogue().values(), *own]
    familiar = sorted({name for item in known for name in item.context})
    unfamiliar = unfamiliar_columns(takes, familiar)
    return [*known, *(ContextDependence.of(name, takes) for name in unfamiliar)]


def explaining(column: str, sensor: str | None, own: Sequence[Effect] = ()) -> list[CorrectionEffect]:
    """Effects that may be behind an error that goes along with ``column``, as ``glovecal where`` calls it:
    those of the catalogue, a user's ``own``, and last what only names the column. ``sensor`` reads it, where
    one does."""
    found = [
        item
        for item in (*catalogue().values(), *own)
        if isinstance(item, CorrectionEffect) and item.about.may_show_in(column, item.context)
    ]
    kind, _, name = column.partition(" ")
    if kind == "context":
        return found or [ContextDependence(name)]
    return [*found, ColumnDependence(sensor)] if sensor is not None else found


def wearing_effect() -> WearingEffect:
    """The effect that knows wearings: a quick check sets it. Raises BadInput when there is none."""
    for item in catalogue().values():
        if isinstance(item, WearingEffect):
            return item
    raise BadInput("no effect of the catalogue knows what changes when the glove is put on again")


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


def effect_of_declaration(document: Mapping[str, Any]) -> Effect:
    """A user's own effect from the JSON document that a job or a model keeps. Raises BadInput."""
    return ExpressionEffect.from_document(document)


def stored_effect(name: str, settings: Settings) -> Effect:
    """The effect of a stored model, declared ones included. Raises BadInput."""
    if "declaration" in settings:
        return ExpressionEffect.from_document(settings["declaration"])
    return effect(name)


def stored_correction(name: str, settings: Settings) -> CorrectionEffect:
    """The same, of an effect that a stored model has with weights. Raises BadInput."""
    found = stored_effect(name, settings)
    if not isinstance(found, CorrectionEffect):
        raise BadInput(f"effect {name!r} has no columns here; install the version it was learned with")
    return found
