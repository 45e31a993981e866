"""``takes/examination``: which sensors stretch which others, and how each rotation should be read."""

from __future__ import annotations

import dataclasses
from typing import Annotated

from fastapi import APIRouter, Response
from pydantic import Field

from glovecal_models.errors import LayoutMismatch
from glovecal_models.independence.independence import examine_independence
from glovecal_models.takes.take import Take
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.request_types import Channel, Id, Identifier, StrictBody
from glovecal_service.store.records import TakeRecord
from glovecal_service.store.store import Store
from glovecal_service.views.examination import ExaminationView, examination_view

router = APIRouter(prefix="/takes/examination", tags=["takes"])

MOST_TAKES = 500
MOST_RANGE_TAKES = 100
LONGEST_RANGE_S = 600.0
"""Longer takes than this are not read for ranges unasked."""


class ExaminationRequest(StrictBody):
    takes: Annotated[list[Id], Field(min_length=1, max_length=MOST_TAKES)] = Field(
        description="In each one rotation was kept still while others moved."
    )
    still: Annotated[dict[Id, Channel], Field(max_length=MOST_TAKES)] = Field(
        default={},
        description="Take: the rotation kept still, where neither the take's name (`still-IM_ABD`) nor "
        "measured angles tell.",
    )
    range_takes: Annotated[list[Id], Field(max_length=MOST_TAKES)] | None = Field(
        None, description="Joints go through their ranges there. None: the subject's other takes."
    )
    layout_name: Identifier | None = Field(None, description="Of the proposed layout.")


@router.post(
    "",
    response_model=ExaminationView,
    summary="Which sensors stretch which others",
    responses=change_problems(409),
)
def examine(body: ExaminationRequest, store: StoreNeeded) -> ExaminationView:
    """A joint is kept still, others move: its sensor's deviation in per cent of its active range, and each
    affecting sensor's own share. Nothing is stored."""
    return _examined(body, store)


@router.post(
    "/report",
    response_class=Response,
    summary="The same as a page with pictures",
    responses=change_problems(409)
    | {
        200: {
            "description": "One HTML file that needs nothing else.",
            "content": {"text/html": {"schema": {"type": "string"}}},
        }
    },
)
def report(body: ExaminationRequest, store: StoreNeeded) -> Response:
    from glovecal_service.report.examination_page import examination_page  # draws: few requests need it

    subject = store.takes.get(body.takes[0]).subject
    return Response(
        examination_page(_examined(body, store).model_dump(), subject), media_type="text/html; charset=utf-8"
    )


def _examined(body: ExaminationRequest, store: Store) -> ExaminationView:
    rows = [store.takes.get(id) for id in dict.fromkeys(body.takes)]
    layout_name = rows[0].layout
    if body.range_takes is None:
        wanted = _others(store, rows)
    else:
        wanted = [store.takes.get(id) for id in dict.fromkeys(body.range_takes)]
    for row in (*rows, *wanted):
        if row.layout != layout_name:
            raise LayoutMismatch(
                f"take {row.id} ({row.name!r}) has layout {row.layout!r}, not {layout_name!r}"
            )
    takes = _loaded(store, rows)
    named = {
        take.name: body.still[row.id] for take, row in zip(takes, rows, strict=True) if row.id in body.still
    }
    found = examine_independence(store.layouts.get(layout_name), takes, _loaded(store, wanted), named)
    return examination_view(found, body.layout_name or f"{layout_name[:55]}-examined")


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
