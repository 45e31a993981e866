"""Which sensors stretch which others, and how should each rotation be read?"""

from __future__ import annotations

import dataclasses
from typing import Annotated

from pydantic import Field

from glovecal_models.errors import LayoutMismatch
from glovecal_models.independence.answer import Independence
from glovecal_models.presentation.document import TakeNamed
from glovecal_models.takes.take import Take
from glovecal_service.questions.at_once import AskedAtOnce, AtOnce
from glovecal_service.request_types import Channel, Id, Identifier, StrictBody
from glovecal_service.store.records import TakeRecord
from glovecal_service.store.store import Store

MOST_TAKES = 500
MOST_RANGE_TAKES = 100
LONGEST_RANGE_S = 600.0
"""Longer takes than this are not read for ranges unasked."""


class ExaminationRequest(StrictBody):
    takes: Annotated[list[Id], Field(min_length=1, max_length=MOST_TAKES)]
    """In each one rotation was kept still while others moved."""
    still: Annotated[dict[Id, Channel], Field(max_length=MOST_TAKES)] = Field(default={})
    """Take: the rotation kept still, where neither the take's name (`still-IM_ABD`) nor measured angles
    tell."""
    range_takes: Annotated[list[Id], Field(max_length=MOST_TAKES)] | None = None
    """Joints go through their ranges there. None: the subject's other takes."""
    layout_name: Identifier | None = None
    """Of the proposed layout."""


def run(asked: AskedAtOnce[ExaminationRequest]) -> Independence:
    from glovecal_models.independence.independence import examine_independence

    request, store = asked.request, asked.store
    rows = [store.takes.get(id) for id in dict.fromkeys(request.takes)]
    layout = rows[0].layout
    if request.range_takes is None:
        wanted = _others(store, rows)
    else:
        wanted = [store.takes.get(id) for id in dict.fromkeys(request.range_takes)]
    for row in (*rows, *wanted):
        if row.layout != layout:
            raise LayoutMismatch(f"take {row.id} ({row.name!r}) has layout {row.layout!r}, not {layout!r}")
    takes = _loaded(store, rows)
    each = zip(takes, rows, strict=True)
    named = {take.name: request.still[row.id] for take, row in each if row.id in request.still}
    found = examine_independence(
        store.layouts.get(layout), takes, _loaded(store, wanted), named, request.layout_name
    )
    taken = [TakeNamed(row.id, row.name) for row in rows]
    return dataclasses.replace(found, subject=rows[0].subject, takes=taken)


def _others(store: Store, rows: list[TakeRecord]) -> list[TakeRecord]:
    """The subject's other takes, the newest first."""
    ids = {row.id for row in rows}
    every = store.takes.list(subject=rows[0].subject, layout=rows[0].layout)
    others = [
        row
        for row in every
        if row.id not in ids and row.is_of(rows[0].known_hand) and row.duration_s <= LONGEST_RANGE_S
    ]
    return others[::-1][:MOST_RANGE_TAKES]


def _loaded(store: Store, rows: list[TakeRecord]) -> list[Take]:
    """Takes of equal names get their ids into them."""
    names = [row.name for row in rows]
    takes = [store.takes.load(row.id) for row in rows]
    return [
        dataclasses.replace(take, name=f"{row.name} ({row.id})") if names.count(row.name) > 1 else take
        for take, row in zip(takes, rows, strict=True)
    ]


QUESTION = AtOnce(
    kind="examination",
    of="takes",
    summary="Which sensors stretch which others",
    help=(
        "A joint is kept still, others move: its sensor's deviation in per cent of its active range, and "
        "each affecting sensor's own share. Nothing is stored."
    ),
    request=ExaminationRequest,
    answer=Independence,
    run=run,
    has_page=True,
)
