"""``models/calibrations``: other programs' calibrations as models, and models of lines as such files."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Response
from pydantic import Field

from glovecal_models.calibration.artifact import dump
from glovecal_service.request_types import Identifier, StrictBody, SubjectName
from glovecal_service.rest.http.dependencies import PartsNeeded
from glovecal_service.rest.http.problem import change_problems, problems
from glovecal_service.rest.http.request_types import ModelInPath
from glovecal_service.rest.model.answer import CalibrationFile, ImportedCalibration
from glovecal_service.rest.model.model_import import ModelImport, import_artifact
from glovecal_service.store.errors import NotFound
from glovecal_service.vendor_calibrations.formats import (
    MOST_CHARACTERS,
    FormatName,
    calibration_format,
    read_model,
    write_model,
)

router = APIRouter(prefix="/models", tags=["models"])


class Calibration(StrictBody):
    format: FormatName
    text: Annotated[str, Field(min_length=1, max_length=MOST_CHARACTERS)] = Field(description="The file's.")
    layout: Identifier = Field(description="Of the glove that it calibrates.")
    subject: SubjectName
    create_subject: bool = Field(False, description="Add the subject if it is not there; else 404.")


@router.post(
    "/calibrations",
    status_code=201,
    response_model=ImportedCalibration,
    summary="Import another program's calibration",
    responses=change_problems(409)
    | {200: {"model": ImportedCalibration, "description": "This very model was here already."}},
)
def import_calibration(body: Calibration, response: Response, parts: PartsNeeded) -> ImportedCalibration:
    """Kept as a model of lines, each with its scale and offset; it is not activated. 422 names the line."""
    try:
        hand = parts.store.subjects.get(body.subject).known_hand or "right"
    except NotFound:
        if not body.create_subject:
            raise
        hand = "right"
    layout = parts.store.layouts.get(body.layout)
    model, found = read_model(body.text, calibration_format(body.format), layout, body.subject, hand)
    options = ModelImport(subject=body.subject, create_subject=body.create_subject, id=None)
    answer = import_artifact(parts, dump(model), options)
    response.status_code = 201 if answer.is_new else 200
    return ImportedCalibration(**dict(answer), left_out=dict(found.left_out), doubts=dict(found.doubts))


@router.get(
    "/{id}/calibration",
    response_model=CalibrationFile,
    summary="A model of lines as another program's calibration",
    responses=problems(),
)
def export_calibration(
    id: ModelInPath, parts: PartsNeeded, format: Annotated[FormatName, Query()]
) -> CalibrationFile:
    """422 where no rotation is a line of one sensor, or effects would be lost."""
    record = parts.store.models.get(id)
    model, _ = parts.predictors.get(record.id)
    hand = parts.store.subjects.get(record.subject).known_hand or "right"
    written = write_model(model, calibration_format(format), hand)
    return CalibrationFile(text=written.text, left_out=dict(written.left_out))
