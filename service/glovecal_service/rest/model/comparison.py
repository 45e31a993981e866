"""``models/{id}/compare`` and ``report``: a model against measurements, in numbers and in pictures."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Response
from pydantic import Field

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.comparison.compare import compare
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_service.jobs.ceiling import known_ceiling
from glovecal_service.jobs.model_work import trained_ids
from glovecal_service.report.caption import ReportedModel, caption_of
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.request_types import Id, ModelInPath, ModelReference, StrictBody
from glovecal_service.store.records import ModelRecord
from glovecal_service.store.store import Store
from glovecal_service.views.comparison import ComparisonView, comparison_view

router = APIRouter(prefix="/models", tags=["models"])

MOST_TAKES = 1000
MOST_BESIDE = 7


class Against(StrictBody):
    takes: Annotated[list[Id], Field(min_length=1, max_length=MOST_TAKES)]


class AgainstBeside(Against):
    beside: Annotated[list[ModelReference], Field(max_length=MOST_BESIDE)] = Field(
        default=[], description="Other models, held against the same takes and shown beside this one."
    )


@router.post(
    "/{id}/compare",
    response_model=ComparisonView,
    summary="The model against measurements",
    responses=change_problems(409),
)
def compare_model(id: ModelInPath, body: Against, parts: PartsNeeded) -> ComparisonView:
    """Errors in degrees, and of fingertips in mm; `trained_on` says which takes it has seen before."""
    record, model, wanted, seen = chosen(id, body, parts)
    takes = [parts.store.takes.load(take) for take in wanted]
    found = compare(model, takes, dimensions=_hand_of(record, parts))
    return comparison_view(found, record.id, seen, known_ceiling(parts.store, record))


@router.post(
    "/{id}/report",
    response_class=Response,
    summary="The comparison as a page with pictures",
    responses=change_problems(409)
    | {
        200: {
            "description": "One HTML file that needs nothing else.",
            "content": {"text/html": {"schema": {"type": "string"}}},
        }
    },
)
def report_on_model(id: ModelInPath, body: AgainstBeside, parts: PartsNeeded) -> Response:
    """Errors, where they are, what they depend on; each picture with a sentence that says what it shows."""
    from glovecal_service.report.comparison_page import report_page  # it draws, and few requests ask for that

    record, model, wanted, seen = chosen(id, body, parts)
    takes = [parts.store.takes.load(take) for take in wanted]
    others = {}
    for reference in body.beside:
        other, loaded, _, also_seen = chosen(reference, body, parts)
        if other.id != record.id:
            others[other.id] = ReportedModel(other.id, loaded, also_seen, caption_of(parts.store, other.id))
    ancestors, simpler = _versions_before(parts, record)
    page = report_page(
        ReportedModel(record.id, model, seen, caption_of(parts.store, record.id)),
        takes,
        list(others.values()),
        ancestors=ancestors,
        simpler=simpler,
        dimensions=_hand_of(record, parts),
        ceiling=known_ceiling(parts.store, record),
    )
    return Response(page, media_type="text/html; charset=utf-8")


def chosen(
    id: str, body: Against, parts: Parts
) -> tuple[ModelRecord, CalibrationModel, list[str], list[str]]:
    """The model, the takes wanted, and those of them it was trained on."""
    record = parts.store.models.get(id)
    model, _ = parts.predictors.get(record.id)
    wanted = list(dict.fromkeys(body.takes))
    seen = _trained_on(parts.store, model, record)
    return record, model, wanted, [take for take in wanted if take in seen]


def _hand_of(record: ModelRecord, parts: Parts) -> HandDimensions:
    return parts.store.subjects.get(record.subject).skeleton().dimensions


def _trained_on(store: Store, model: CalibrationModel, record: ModelRecord) -> set[str]:
    """Ids of the takes whose frames the model has seen."""
    named = {take["id"] if isinstance(take, dict) else take for take in record.facts.get("takes", [])}
    by_hash = {take.id for take in store.takes.list(subject=record.subject) if take.artifact in model.takes}
    return named | by_hash


def _versions_before(
    parts: Parts, record: ModelRecord
) -> tuple[list[CalibrationModel], dict[str, CalibrationModel]]:
    """Ancestors, oldest first, and calibrations by method; both empty for a first version.

    Raises DamagedArtifact, NotFound.
    """
    older = parts.store.models.lineage(record.id)[:0:-1]
    if not older:
        return [], {}
    ancestors = [parts.predictors.get(item.id)[0] for item in older]
    methods = {model.method for model in ancestors}
    takes = [parts.store.takes.load(id) for id in trained_ids(parts.store, older[0])]
    layout = ancestors[0].layout
    simpler = {
        method: train(takes, layout, record.subject, TrainingSettings(method=method, folds=0))
        for method in ("raw", "linear")
        if method not in methods
    }
    return ancestors, simpler
