"""``models/{id}/next-steps``: what to record next, so that a model learns most for the time."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query

from glovecal_models.calibration.artifact import load
from glovecal_models.sampling.active.next_step import propose_for_model
from glovecal_service.plain import plain
from glovecal_service.questions.chosen_takes import model_takes
from glovecal_service.questions.diagnose import newest_diagnosis
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.problem import problems
from glovecal_service.rest.http.request_types import ModelInPath
from glovecal_service.rest.sampling.answer import DiagnosedTakeView, NextStepsView
from glovecal_service.store.records import ModelRecord, TakeRecord
from glovecal_service.store.store import Store

router = APIRouter(prefix="/models", tags=["models"])

MOST_OTHER_TAKES = 20
LONGEST_OTHER_S = 600.0
"""Longer takes than this are not read for everyday readings."""


@router.get(
    "/{id}/next-steps",
    response_model=NextStepsView,
    summary="What to record next",
    responses=problems(409),
)
def next_steps(
    id: ModelInPath, store: StoreNeeded, most: Annotated[int, Query(ge=1, le=200)] = 10
) -> NextStepsView:
    """Poses, ramps and widgets by the expected fall of the error per second of capture. Nothing is stored;
    `POST /v1/sampling` with protocol `active` asks for them one after the other."""
    record = store.models.get(id)
    rows = model_takes(store, record, None)
    takes = [store.takes.load(row.id) for row in rows]
    others = [store.takes.load(row.id) for row in _others(store, record, rows)]
    model = load(store.models.load_bytes(record.id), expected_id=record.id)
    found = propose_for_model(model, takes, others)
    told = plain(found.to_document(most))
    return NextStepsView(model=record.id, **told, diagnosed=_diagnosed(store, record))


def _diagnosed(store: Store, record: ModelRecord) -> DiagnosedTakeView | None:
    newest = newest_diagnosis(store, record)
    wanted = None if newest is None else newest.next_take
    return None if wanted is None else DiagnosedTakeView.model_validate(wanted, from_attributes=True)


def _others(store: Store, record: ModelRecord, trained: list[TakeRecord]) -> list[TakeRecord]:
    """The subject's other takes of the same wearings, the newest first."""
    ids, wearings = {row.id for row in trained}, {row.wearing for row in trained}
    every = store.takes.list(subject=record.subject, layout=record.layout)
    others = [
        row for row in every if row.id not in ids and row.wearing in wearings and row.is_of(record.hand)
    ]
    return [row for row in others if row.duration_s <= LONGEST_OTHER_S][::-1][:MOST_OTHER_TAKES]
