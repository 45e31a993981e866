"""``models/{id}/next-steps``: what to record next, so that a model learns most for the time."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Query
from pydantic import BaseModel, Field

from glovecal_models.calibration.artifact import load
from glovecal_models.sampling.active.next_step import diagnosed_take, propose_for_model
from glovecal_service.plain import plain
from glovecal_service.rest.http.answers import problems
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.request_types import ModelInPath
from glovecal_service.rest.model.model_takes import model_takes
from glovecal_service.store.records import ModelRecord, TakeRecord
from glovecal_service.store.store import Store

router = APIRouter(prefix="/models", tags=["models"])

MOST_OTHER_TAKES = 20
LONGEST_OTHER_S = 600.0
"""Longer takes than this are not read for everyday readings."""


class ProposedStepView(BaseModel):
    name: str
    ask: str = Field(description="What the person is asked to do.")
    needs: str
    seconds: float = Field(description="Capture time, with countdown and settling.")
    angles: dict[str, float] = Field(description="Degrees by rotation that are then known.")
    sd_deg: dict[str, float] = Field(description="Standard deviation now, of the rotations it teaches.")
    sd_after_deg: dict[str, float]
    rms_sd_after_deg: float = Field(description="Over all rotations.")
    error_fall_deg: float = Field(description="Of the expected error of a frame, noise included.")
    sentence: str


class DiagnosedTakeView(BaseModel):
    what: str
    seconds: float
    separates: list[str]
    reason: str


class NextStepsView(BaseModel):
    model: str
    rms_sd_deg: float = Field(description="Root mean variance over everyday readings and rotations, now.")
    sd_deg: dict[str, float]
    noise_deg: dict[str, float] = Field(description="Of a single frame.")
    enough: bool = Field(description="No step is worth its time any more.")
    steps: list[ProposedStepView] = Field(description="The one that teaches most for its time first.")
    diagnosed: DiagnosedTakeView | None = Field(
        description="What the newest diagnosis of the model asks for."
    )
    assumed: list[str] = Field(description="Rotations whose hyperparameters are assumed, not learned.")
    sentences: list[str]


@router.get(
    "/{id}/next-steps",
    response_model=NextStepsView,
    summary="What to record next",
    responses=problems(409),
)
def next_steps(
    id: ModelInPath, store: StoreNeeded, most: Annotated[int, Query(ge=1, le=200)] = 10
) -> dict[str, Any]:
    """Poses, ramps and widgets by the expected fall of the error per second of capture. Nothing is stored;
    `POST /v1/sampling` with protocol `active` asks for them one after the other."""
    record = store.models.get(id)
    rows = model_takes(store, record, None)
    takes = [store.takes.load(row.id) for row in rows]
    others = [store.takes.load(row.id) for row in _others(store, record, rows)]
    model = load(store.models.load_bytes(record.id), expected_id=record.id)
    found = propose_for_model(model, takes, others)
    return plain(
        {"model": record.id, **found.to_document(most), "diagnosed": _newest_diagnosis(store, record)}
    )


def _others(store: Store, record: ModelRecord, trained: list[TakeRecord]) -> list[TakeRecord]:
    """The subject's other takes of the same wearings, the newest first."""
    ids, wearings = {row.id for row in trained}, {row.wearing for row in trained}
    every = store.takes.list(subject=record.subject, layout=record.layout)
    others = [
        row for row in every if row.id not in ids and row.wearing in wearings and row.is_of(record.hand)
    ]
    return [row for row in others if row.duration_s <= LONGEST_OTHER_S][::-1][:MOST_OTHER_TAKES]


def _newest_diagnosis(store: Store, record: ModelRecord) -> dict[str, Any] | None:
    done = [
        job
        for job in store.jobs.list(subject=record.subject)
        if job.kind == "diagnose" and job.state == "done" and (job.result or {}).get("model") == record.id
    ]
    newest = max(done, key=lambda job: job.updated_at, default=None)
    return None if newest is None else diagnosed_take(newest.result or {})
