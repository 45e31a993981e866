"""``takes/examination``: which sensors stretch which others, and how each rotation should be read."""

from __future__ import annotations

import dataclasses
from typing import Annotated, Any

from fastapi import APIRouter, Response
from pydantic import BaseModel, Field

from glovecal_models.errors import LayoutMismatch
from glovecal_models.independence.independence import examine_independence
from glovecal_models.independence.proposal import independence_document
from glovecal_models.takes.take import Take
from glovecal_service.plain import plain
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.request_types import Channel, Id, Identifier, StrictBody
from glovecal_service.store.records import TakeRecord
from glovecal_service.store.store import Store

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


class ShareView(BaseModel):
    sensor: str
    std_pct: float | None
    std_low: float | None = Field(description="95 % interval, pieces of time weighted anew.")
    std_high: float | None
    max_pct: float | None
    max_low: float | None
    max_high: float | None
    affects: str = Field(description='By the 5 % and 12 % rule: "yes", "no" or "undecided".')
    moved_pct: float | None = Field(description="How much of its own range it was moved through.")
    rivals: list[str] = Field(description="Sensors that always moved along and could be the cause.")


class StillView(BaseModel):
    std_pct: float | None
    span_pct: float | None
    is_still: bool


class ActiveRangeView(BaseModel):
    readings: float | None
    source: str
    angle_deg: float | None


class ExaminedRotationView(BaseModel):
    rotation: str
    sensor: str
    takes: list[str]
    seconds: float
    std_pct: float | None = Field(description="Standard deviation, per cent of the active range.")
    max_pct: float | None
    is_coupled: bool
    unexplained_pct: float | None = Field(description="RMS that no other sensor explains.")
    affecting: list[ShareView]
    not_moved: list[str]
    still: StillView | None = Field(description="By measured angles; null where there are none.")
    active_range: ActiveRangeView
    doubts: list[str]


class OneWayView(BaseModel):
    affecting: str
    affected: str
    sentence: str


class WornSideView(BaseModel):
    verdict: str = Field(description='"as it should be", "other hand", "back to front" or "not judgeable".')
    probability: float | None = Field(description="That signs by lot agree so well.")
    reversed_sensors: list[str]
    sentence: str


class ProposalView(BaseModel):
    rotation: str
    kind: str
    sensors: list[str]
    kind_now: str
    sensors_now: list[str]
    is_sure: bool | None = Field(description="null: not examined, it stays as it is.")
    is_change: bool
    sentence: str


class RuleView(BaseModel):
    std_pct: float
    max_pct: float


class ExaminationView(BaseModel):
    layout: str
    rule: RuleView
    sensors: list[str]
    still: dict[str, list[str]]
    rotations: list[ExaminedRotationView]
    one_way: list[OneWayView]
    dead_sensors: list[str]
    worn_side: WornSideView
    proposals: list[ProposalView]
    proposed_layout: dict[str, Any] = Field(
        description="With the proposals that are sure; store it with PUT gloves/{layout}."
    )
    sentences: list[str] = Field(description="What is odd.")


@router.post(
    "",
    response_model=ExaminationView,
    summary="Which sensors stretch which others",
    responses=change_problems(409),
)
def examine(body: ExaminationRequest, store: StoreNeeded) -> dict[str, Any]:
    """A joint is kept still, others move: its sensor's deviation in per cent of its active range, and each
    affecting sensor's own share. Nothing is stored."""
    return _document(body, store)


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
    return Response(examination_page(_document(body, store), subject), media_type="text/html; charset=utf-8")


def _document(body: ExaminationRequest, store: Store) -> dict[str, Any]:
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
    return plain(independence_document(found, body.layout_name or f"{layout_name[:55]}-examined"))


def _others(store: Store, rows: list[TakeRecord]) -> list[TakeRecord]:
    """The subject's other takes, the newest first."""
    ids = {row.id for row in rows}
    every = store.takes.list(subject=rows[0].subject, layout=rows[0].layout)
    others = [row for row in every if row.id not in ids and row.duration_s <= LONGEST_RANGE_S]
    return others[::-1][:MOST_RANGE_TAKES]


def _loaded(store: Store, rows: list[TakeRecord]) -> list[Take]:
    """Takes of equal names get their ids into them."""
    names = [row.name for row in rows]
    takes = [store.takes.load(row.id) for row in rows]
    return [
        dataclasses.replace(take, name=f"{row.name} ({row.id})") if names.count(row.name) > 1 else take
        for take, row in zip(takes, rows, strict=True)
    ]
