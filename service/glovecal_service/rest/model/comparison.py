"""``models/{id}/report``: a model against measurements in pictures; and the takes of other comparisons."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from fastapi import APIRouter, Response
from pydantic import Field

from glovecal_models.calibration.explanation import chosen_rotations
from glovecal_models.calibration.methods import Method
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.comparison.compare import summed_up
from glovecal_models.comparison.delay_curve import live_and_delayed
from glovecal_models.comparison.noise_floor import rotation_noise
from glovecal_models.comparison.residuals import Residuals, residuals
from glovecal_models.comparison.where_it_fails import where_it_fails
from glovecal_models.improvement.fall.lineage import SIMPLER, simpler_calibrations
from glovecal_service.questions.body import OfTakes
from glovecal_service.questions.chosen_takes import takes_for
from glovecal_service.questions.comparison import COMPARE, WHERE, ComparisonRequest, trained_on
from glovecal_service.questions.model_work import trained_ids
from glovecal_service.request_types import ModelReference
from glovecal_service.rest.asking import asked_at_once
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.problem import change_problems
from glovecal_service.rest.http.report_page import REPORT, ReportFormat, report_response
from glovecal_service.rest.http.request_types import ModelInPath
from glovecal_service.store.records import ModelRecord, TakeRecord

router = APIRouter(prefix="/models", tags=["models"])

MOST_BESIDE = 7


class AgainstBeside(OfTakes, ComparisonRequest):
    beside: Annotated[list[ModelReference], Field(max_length=MOST_BESIDE)] = Field(
        default=[], description="Other models, held against the same takes and shown beside this one."
    )


@router.post(
    "/{id}/report",
    response_class=Response,
    summary="The comparison as a page with pictures",
    responses=change_problems(409) | REPORT,
)
def report_on_model(
    id: ModelInPath, body: AgainstBeside, parts: PartsNeeded, form: ReportFormat = "html"
) -> Response:
    """Errors, where they are, what they depend on; each picture with a sentence that says what it shows."""
    from glovecal_service.report.comparison_page import comparison_page  # few requests draw

    store = parts.store
    asked, where_asked = (asked_at_once(parts, question, id, body) for question in (COMPARE, WHERE))
    assert asked.loaded is not None
    assert asked.model is not None
    on = COMPARE.on_takes(store, asked, {})
    found = residuals(asked.loaded, on.takes, offline=body.offline)
    causal = live_and_delayed(asked.loaded, on.takes, found) if body.offline else None
    noise = rotation_noise(found)
    others = {}
    for reference in body.beside:
        other = COMPARE.answered(store, asked_at_once(parts, COMPARE, reference, body))
        others[other.model] = other
    others.pop(asked.model.id, None)
    page = comparison_page(
        asked.loaded,
        COMPARE.named(store, asked, summed_up(found, noise, causal=causal, dimensions=on.hand)),
        WHERE.named(store, where_asked, where_it_fails(found, noise=noise)),
        found,
        noise,
        list(others.values()),
        *_versions_before(parts, asked.model),
    )
    return report_response(page, form)


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
    wanted: list[Method] = [method for method in SIMPLER if method not in methods]
    return ancestors, simpler_calibrations(takes, ancestors[0].layout, record.subject, wanted, 0)


@dataclass(frozen=True)
class ComparedTakes:
    """A model, takes of its subject and layout that were measured, and what is left between them."""

    model: ModelRecord
    takes: tuple[TakeRecord, ...]
    found: Residuals
    """In the order of ``takes``."""
    trained_on: frozenset[str]
    """Ids of those takes that the model was trained on."""


def compared_takes(id: str, takes: Sequence[str], rotation: str | None, parts: Parts) -> ComparedTakes:
    """Takes by id or name. Raises NotFound, Conflict, LayoutMismatch, NotTrainable (no reference angles),
    and BadInput for a ``rotation`` that the model does not have."""
    record = parts.store.models.get(id)
    rows = takes_for(parts.store, record, takes)
    model, _ = parts.predictors.get(record.id)
    if rotation is not None:
        chosen_rotations(model, [rotation])
    found = residuals(model, [parts.store.takes.load(row.id) for row in rows])
    return ComparedTakes(record, tuple(rows), found, frozenset(trained_on(record, model, rows)))
