"""Takes that a model is worked on with: those named, else those it was trained on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from pydantic import Field

from glovecal_models.errors import LayoutMismatch, NotTrainable
from glovecal_models.hand.rotations import Handedness
from glovecal_models.names import did_you_mean
from glovecal_service.questions.model_work import trained_ids
from glovecal_service.questions.training_takes import require_one_hand
from glovecal_service.request_types import TakeReference
from glovecal_service.store.errors import Conflict, NotFound
from glovecal_service.store.records import ModelRecord, TakeRecord
from glovecal_service.store.store import Store

MOST_TAKES = 1000
MOST_SHOWN = 8
SHORTEST_BEGINNING = 4
"""Of an id."""

TakesNamed = Annotated[list[TakeReference], Field(min_length=1, max_length=MOST_TAKES)]


def model_takes(store: Store, model: ModelRecord, wanted: Sequence[str] | None) -> list[TakeRecord]:
    """``wanted`` are ids or names, None: the training takes that have a reference.

    Raises NotFound, Conflict (another subject's take, the other hand's, or a name that several have),
    LayoutMismatch, NotTrainable (no reference angles).
    """
    if wanted is None:
        found = [store.takes.get(id) for id in trained_ids(store, model)]
        found = [take for take in found if take.has_reference]
        if not found:
            raise NotTrainable(
                f"no take that model {model.id[:12]} was trained on has reference angles any more; name some"
            )
        return found
    return takes_for(store, model, wanted)


def any_takes(store: Store, subject: str, wanted: Sequence[str]) -> list[TakeRecord]:
    """Takes by id, or of ``subject`` by name, each once, whoever's they are. Raises NotFound, Conflict."""
    return list({take.id: take for take in _named(store, wanted, subject)}.values())


def takes_for(
    store: Store, model: ModelRecord, wanted: Sequence[str], *, measured: bool = True
) -> list[TakeRecord]:
    """Takes named for work on a model. Raises as ``model_takes``."""
    found = takes_named(store, wanted, model.subject, model.layout, measured=measured)
    for take in found:
        if not take.is_of(model.hand):
            raise Conflict(
                f"take {take.id} ({take.name!r}) is of the {take.known_hand} hand, model {model.id[:12]} of "
                f"the {model.hand} one"
            )
    return found


def takes_named(
    store: Store, wanted: Sequence[str], subject: str, layout: str, *, measured: bool = True
) -> list[TakeRecord]:
    """Takes of one subject, layout and hand, each once, by id or name; without ``measured`` also those that
    have no reference. Raises as ``model_takes``."""
    found = _named(store, wanted, subject)
    for take in found:
        if take.subject != subject:
            raise Conflict(f"take {take.id} ({take.name!r}) is of subject {take.subject!r}, not {subject!r}")
        if take.layout != layout:
            raise LayoutMismatch(f"take {take.id} ({take.name!r}) has layout {take.layout!r}, not {layout!r}")
        if measured and not take.has_reference:
            raise NotTrainable(
                f"take {take.id} ({take.name!r}) has no reference angles; attach some with "
                f"PUT /v1/takes/{take.id}/reference"
            )
    require_one_hand(found)
    return list({take.id: take for take in found}.values())


def measured_takes(
    store: Store, subject: str, wanted: Sequence[str] | None, layout: str | None, hand: Handedness | None
) -> list[TakeRecord]:
    """Takes of one subject with reference angles: those ``wanted``, None for all; of one layout and hand.

    Raises as ``model_takes``.
    """
    if wanted is None:
        own = store.takes.list(subject)
        found = [take for take in own if take.has_reference and take.is_of(hand)]
    else:
        found = _named(store, wanted, subject)
    found = [take for take in found if layout is None or take.layout == layout]
    if not found:
        raise NotTrainable(
            f"subject {subject!r} has no take with reference angles; import some, or attach angles"
        )
    layouts = sorted({take.layout for take in found})
    if len(layouts) > 1:
        raise Conflict(f"the takes have layouts {', '.join(layouts)}; name one of them, or some takes")
    return takes_named(store, [take.id for take in found], subject, layouts[0])


def _named(store: Store, wanted: Sequence[str], subject: str) -> list[TakeRecord]:
    """Anybody's by id; ``subject``'s own by name, or by the beginning of an id."""
    found, own = [], None
    for name in wanted:
        try:
            found.append(store.takes.get(name))
        except NotFound:
            own = store.takes.list(subject) if own is None else own
            found.append(_one(own, name, subject))
    return found


def _one(own: Sequence[TakeRecord], wanted: str, subject: str) -> TakeRecord:
    found = [take for take in own if take.name == wanted]
    if not found and len(wanted) >= SHORTEST_BEGINNING:
        found = [take for take in own if take.id.startswith(wanted)]
    if len(found) > 1:
        ids = ", ".join(take.id for take in found[:MOST_SHOWN])
        raise Conflict(f"{len(found)} takes of {subject!r} are called {wanted!r}: {ids}; give the id of one")
    if not found:
        meant = did_you_mean(wanted, (take.name for take in own))
        raise NotFound(f"subject {subject!r} has no take {wanted!r}; {meant}")
    return found[0]
