"""``models/{id}/quick-check``: a new wearing's shift from a few held poses, at once."""

from __future__ import annotations

from fastapi import APIRouter
from pydantic import Field

from glovecal_models.calibration.artifact import dump
from glovecal_models.calibration.sensor_sensitivity import sensor_sensitivity
from glovecal_models.quick_check.pose_book import PoseBook, own_poses, usual_poses
from glovecal_models.quick_check.quick_check import QuickCheck, quick_check
from glovecal_models.quick_check.text import quick_check_sentences
from glovecal_models.takes.take import Take
from glovecal_service.jobs.model_work import trained_ids
from glovecal_service.plain import plain
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.request_types import ModelInPath, StrictBody
from glovecal_service.rest.model.model_takes import TakesNamed, takes_for
from glovecal_service.store.errors import NotFound
from glovecal_service.store.records import ModelRecord, TakeRecord
from glovecal_service.views.quick_check import QuickCheckView, found_and_left, quick_check_view

router = APIRouter(prefix="/models", tags=["models"])


class Check(StrictBody):
    takes: TakesNamed = Field(
        description="Ids or names of short takes of one new wearing, with three to five poses held. Angles "
        "are measured (`r.` columns), or known by the pose's name (column `pose`, or the take's name)."
    )
    activate: bool = Field(False, description="Predict live with the child.")


@router.post(
    "/{id}/quick-check",
    response_model=QuickCheckView,
    summary="Check a new wearing with a few poses",
    responses=change_problems(409),
)
def check_wearing(id: ModelInPath, body: Check, parts: PartsNeeded) -> QuickCheckView:
    """Stores a child model with the wearing's shift; this one stays as it is, and rolling back undoes it.

    422 when no pose was held, when no angle is known, and when the poses contradict the model or each other.
    """
    record = parts.store.models.get(id)
    model, _ = parts.predictors.get(record.id)
    rows = takes_for(parts.store, record, body.takes, measured=False)
    takes = [parts.store.takes.load(row.id) for row in rows]
    trained = _training_takes(parts, record)
    sensitivity = sensor_sensitivity(model)
    ranges = dict(zip(sensitivity.sensors, sensitivity.range.tolist(), strict=True))
    known: PoseBook = usual_poses()
    if any(take.poses is not None or not take.rotations for take in takes):
        known = own_poses(_loaded(parts, trained), ranges)
    found = quick_check(
        model,
        takes,
        known=known,
        trained_wearings=[row.wearing for row in trained],
        parent_id=record.id,
    )
    child = _keep(parts, record, found, rows)
    if body.activate:
        parts.store.models.activate(child.id)
    return quick_check_view(found, child.id, record.id, active=body.activate)


def _training_takes(parts: Parts, record: ModelRecord) -> list[TakeRecord]:
    """Those that are still stored."""
    found = []
    for id in trained_ids(parts.store, record) if record.facts.get("takes") else ():
        try:
            found.append(parts.store.takes.get(id))
        except NotFound:
            continue
    return found


def _loaded(parts: Parts, rows: list[TakeRecord]) -> list[Take]:
    return [parts.store.takes.load(row.id) for row in rows if row.has_reference]


def _keep(parts: Parts, parent: ModelRecord, found: QuickCheck, rows: list[TakeRecord]) -> ModelRecord:
    """The child: trained on what its parent was, and checked with ``rows``."""
    check = {
        "wearing": found.wearing,
        "takes": [row.id for row in rows],
        **found_and_left(found),
        "expected": found.report.expected,
        "sentences": quick_check_sentences(found),
    }
    facts = {**parent.facts, "simulated": found.model.simulated, "quick_check": check}
    return parts.store.models.add(
        dump(found.model),
        subject=parent.subject,
        layout=parent.layout,
        method=parent.method,
        parent=parent.id,
        facts=plain(facts),
    )
