"""``takes/session-drift``: the calibration shapes at the start of a session against those at its end."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter
from pydantic import Field

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import Handedness
from glovecal_models.takes.session_drift import END, SHAPES, START, SessionDrift, session_drift
from glovecal_models.takes.text import drift_sentence
from glovecal_service.request_types import StrictBody, SubjectName, WearingName
from glovecal_service.rest.http.dependencies import PartsNeeded
from glovecal_service.rest.http.problem import change_problems, problems
from glovecal_service.rest.take.answer import SessionDriftView
from glovecal_service.store.records import TakeRecord


def _view(found: SessionDrift) -> SessionDriftView:
    turned = zip(found.rotations, found.common_deg.tolist(), strict=True) if found.rotations else ()
    return SessionDriftView(
        shapes=list(found.shapes),
        rms_deg=found.rms_deg,
        mean_deg=dict(turned),
        mean_counts=dict(zip(found.sensors, found.common_counts.tolist(), strict=True)),
        left_out=dict(found.left_out),
        sentence=drift_sentence(found),
    )


router = APIRouter(prefix="/takes/session-drift", tags=["takes"])


class SessionDriftRequest(StrictBody):
    subject: SubjectName
    wearing: Annotated[WearingName | None, Field(description="Null: the newest that has both.")] = None
    hand: Handedness | None = Field(None, description="Of a subject with two gloves, which.")


@router.get("", response_model=dict[str, str], summary="Hand shapes of a session", responses=problems())
def get_shapes() -> dict[str, str]:
    """Each with what to ask a person for, in order."""
    return SHAPES


@router.post(
    "", response_model=SessionDriftView, summary="Drift of a session", responses=change_problems(409)
)
def examine_session(body: SessionDriftRequest, parts: PartsNeeded) -> SessionDriftView:
    """Takes named `start-SHAPE` and `end-SHAPE`, the newest of each; angles by the model that is active."""
    records = [take for take in parts.store.takes.list(body.subject) if take.is_of(body.hand)]
    wearings = (
        [body.wearing] if body.wearing else list(dict.fromkeys(one.wearing for one in reversed(records)))
    )
    for wearing in wearings:
        start, end = (_sequence(records, wearing, place) for place in (START, END))
        if start and end:
            break
    else:
        raise BadInput(
            f"{body.subject} has no wearing with both sequences: record the shapes at the start and at the "
            "end, as glovecal shapes does"
        )
    layout = next(iter(start.values())).layout
    model = parts.store.models.active(body.subject, layout, body.hand)
    predictor = None if model is None else parts.predictors.get(model.id)[1]
    first, last = (
        {shape: parts.store.takes.load(record.id) for shape, record in sequence.items()}
        for sequence in (start, end)
    )
    if predictor is None:
        return _view(session_drift(first, last, None))
    with parts.predictors.one_at_a_time:
        return _view(session_drift(first, last, predictor))


def _sequence(records: list[TakeRecord], wearing: str, place: str) -> dict[str, TakeRecord]:
    """The newest take of each shape."""
    found = {one.name: one for one in records if one.wearing == wearing}
    return {shape: found[place + shape] for shape in SHAPES if place + shape in found}
