"""The effects that are known by name, and those of one's own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TypeVar, overload

from glovecal._shown import Shown
from glovecal._table import Column, Table
from glovecal_models.effects.base.effect import Effect, kind_of
from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean

Kind = TypeVar("Kind", bound=type[Effect])
COLUMNS = (Column("effect"), Column("kind"), Column("context"), Column("explanation"))


class Catalogue(Mapping[str, Effect], Shown):
    """Effects by name."""

    def __init__(self, known: Mapping[str, Effect]) -> None:
        self._known = dict(known)

    def __getitem__(self, name: str) -> Effect:
        if name not in self._known:
            raise KeyError(f"no effect {name!r}; {did_you_mean(name, self._known)}")
        return self._known[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._known)

    def __len__(self) -> int:
        return len(self._known)

    def table(self) -> Table:
        """One row for each effect: its name, how it acts on a model, the context columns it needs."""
        rows = [
            (name, kind_of(item), ", ".join(f"c.{column}" for column in item.context), item.about.explanation)
            for name, item in self._known.items()
        ]
        return Table.of(COLUMNS, rows)


def effects() -> Catalogue:
    """Every effect that a diagnosis tries, by name: the built-in ones, those of installed packages (entry
    points of the group ``glovecal.effects``) and those registered in this process.

    Raises BadInput for an entry point that is no effect.
    """
    from glovecal_models.effects.catalogue import catalogue

    return Catalogue(catalogue())


@overload
def register_effect(effect: Kind) -> Kind: ...
@overload
def register_effect(effect: Effect) -> Effect: ...
def register_effect(effect: type[Effect] | Effect) -> type[Effect] | Effect:
    """Make an effect of your own known for as long as this process lives; also a decorator of its class.

    A notebook needs no package for it; a model that holds the effect is predicted with only where the effect
    is known, so install it as an entry point before you hand the model on. Running the cell again replaces
    the effect. Raises BadInput when the name belongs to another effect, and for relations to one that is not
    known.
    """
    from glovecal_models.effects.catalogue import check_relations, registered_effects

    instance = effect() if isinstance(effect, type) else effect
    if not isinstance(instance, Effect):
        raise BadInput(
            f"{effect!r} is no Effect; derive it from InstantEffect, HistoryEffect or another base"
        )
    known = registered_effects()
    before = known.get(instance.name)
    if before is not None and _home(before) != _home(instance):
        raise BadInput(f"there is an effect {instance.name!r} already; give yours another name")
    check_relations({**known, instance.name: instance})
    known[instance.name] = instance
    return effect


def declared(texts: Sequence[str]) -> list[Effect]:
    """Effects from lines such as ``name = strap; columns = c.strap_n * own``. Raises BadInput."""
    from glovecal_models.effects.catalogue import declared_effect

    return [declared_effect(text) for text in texts]


def is_declaration(effect: str) -> bool:
    """Whether the text declares an effect instead of naming one."""
    return "=" in effect


def _home(effect: Effect) -> tuple[str, str]:
    return type(effect).__module__, type(effect).__qualname__
