"""Takes that a model is worked on with: those named, else those it was trained on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from pydantic import Field

from glovecal_models.errors import LayoutMismatch, NotTrainable
from glovecal_models.names import did_you_mean
from glovecal_service.jobs.model_work import trained_ids
from glovecal_service.jobs.training_takes import require_one_hand
from glovecal_service.rest.http.request_types import TakeReference
from glovecal_service.store.errors import Conflict, NotFound
from glovecal_service.store.records import ModelRecord, TakeRecord
from glovecal_service.store.store import Store

MOST_TAKES = 1000
MOST_SHOWN = 8

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
    every = store.takes.list()
    found = [_one(every, name, subject) for name in wanted]
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


def _one(every: Sequence[TakeRecord], wanted: str, subject: str) -> TakeRecord:
    for take in every:
        if take.id == wanted:
            return take
    own = [take for take in every if take.subject == subject]
    found = [take for take in own if take.name == wanted]
    if len(found) > 1:
        ids = ", ".join(take.id for take in found[:MOST_SHOWN])
        raise Conflict(f"{len(found)} takes of {subject!r} are called {wanted!r}: {ids}; give the id of one")
    if not found:
        meant = did_you_mean(wanted, (take.name for take in own))
        raise NotFound(f"subject {subject!r} has no take {wanted!r}; {meant}")
    return found[0]
