"""``models/import``: a model's artifact from another service, tried before it is kept."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import anyio.to_thread
import numpy as np
from fastapi import APIRouter, Query, Request, Response
from fastapi import Path as InPath
from pydantic import BaseModel, Field, ValidationError

from glovecal_client.encryption.kept_file import read_kept
from glovecal_models.calibration.artifact import load, model_id
from glovecal_models.calibration.explanation import FrameExplainer
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.servable import check_servable
from glovecal_models.errors import BadInput, DamagedArtifact
from glovecal_service.request_types import SHA256, SHA256_PREFIX, SubjectName
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.problem import Problem, change_problems
from glovecal_service.rest.model.answer import ImportedModel
from glovecal_service.rest.model.models import model_in_full, model_row
from glovecal_service.rest.take.uploaded_files import kept_upload
from glovecal_service.store.database import now
from glovecal_service.store.errors import Conflict, NotFound
from glovecal_service.store.records import ModelRecord, TakeRecord, hand_of

router = APIRouter(prefix="/models", tags=["models"])

MEDIA_TYPE = "application/octet-stream"


class ModelImport(BaseModel):
    """Query parameters of an import."""

    subject: SubjectName | None = Field(None, description="Null: the subject that the model names.")
    create_subject: bool = Field(False, description="Add the subject if it is not there; else 404.")
    id: str | None = Field(
        None, pattern=SHA256_PREFIX,
        description="The model's id where it was exported, or its first digits; 422 for another file. "
        "Null: what the file holds is taken for what was sent.",
    )  # fmt: skip


@router.post(
    "/import",
    status_code=201,
    response_model=ImportedModel,
    summary="Import a model's artifact",
    responses=change_problems(409, 415)
    | {200: {"model": ImportedModel, "description": "This very model was here already."}},
    openapi_extra={
        "requestBody": {
            "required": True,
            "content": {MEDIA_TYPE: {"schema": {"type": "string", "format": "binary"}}},
        }
    },
)
async def import_model(
    request: Request, response: Response, parts: PartsNeeded, options: Annotated[ModelImport, Query()]
) -> ImportedModel:
    """The body is what `models/{id}/export` gave. Nothing in it is executed; a file that does not predict a
    frame is refused and changes nothing. The model is not activated.

    409: its layout's name belongs to another layout here, or another subject has this very model.
    """
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind != MEDIA_TYPE:
        raise Problem(415, "media-type", f"a model is sent as {MEDIA_TYPE}, not {kind or 'nothing'!r}")
    upload = await parts.uploads.receive(request.stream())
    try:
        found = await anyio.to_thread.run_sync(
            _import, parts, upload.path, options, limiter=parts.import_slots
        )
    finally:
        if upload.is_new:  # what was good is an artifact now
            upload.path.unlink(missing_ok=True)
    response.status_code = 201 if found.is_new else 200
    return found


@router.post(
    "/import/{upload}",
    status_code=201,
    response_model=ImportedModel,
    summary="Import a model's artifact that was sent to uploads",
    responses=change_problems(409)
    | {200: {"model": ImportedModel, "description": "This very model was here already."}},
)
def import_upload(
    upload: Annotated[str, InPath(pattern=SHA256)],
    response: Response,
    parts: PartsNeeded,
    options: Annotated[ModelImport, Query()],
) -> ImportedModel:
    """As `models/import` does with a file's bytes."""
    imported = _import(parts, kept_upload(parts, upload), options)
    response.status_code = 201 if imported.is_new else 200
    return imported


def _import(parts: Parts, path: Path, options: ModelImport) -> ImportedModel:
    return import_artifact(parts, read_kept(path), options)


def import_artifact(parts: Parts, artifact: bytes, options: ModelImport) -> ImportedModel:
    """Raises BadInput for what does not predict a frame, NotFound, Conflict."""
    if options.id is not None and not model_id(artifact).startswith(options.id):
        raise BadInput(
            f"no model was imported: the sender's is {options.id[:12]}, this file is "
            f"{model_id(artifact)[:12]}: it was changed on its way; send it again"
        )
    model = _tried(artifact)
    subject = options.subject or model.subject
    layout_is_new = _layout_is_new(parts, model)
    subject_created = options.create_subject and all(
        each.name != subject for each in parts.store.subjects.list()
    )
    if subject_created:
        parts.store.subjects.create(subject)
    else:
        parts.store.subjects.get(subject)
    if layout_is_new:
        parts.store.layouts.put(model.layout)
    known = {record.id for record in parts.store.models.list()}
    takes = parts.store.takes.list(subject)
    record = parts.store.models.add(
        artifact,
        subject=subject,
        layout=model.layout.name,
        method=model.method,
        parent=model.parent if model.parent in known else None,
        facts=_facts(model, takes),
        hand=hand_of(take for take in takes if take.artifact in model.takes),
    )
    return ImportedModel(
        model=model_row(record, parts.store.models.is_active(record)),
        is_new=record.id not in known,
        layout_is_new=layout_is_new,
        subject_created=subject_created,
    )


def _tried(artifact: bytes) -> CalibrationModel:
    """Read, shown and made to predict a frame: what does not fit is refused here, not found on stage."""
    try:
        model = load(artifact)
        readings = np.zeros(len(model.layout.sensors))
        if model.sensor_centre is not None:
            readings = np.asarray(model.sensor_centre, float)
        if not model.rotations or readings.shape != (len(model.layout.sensors),):
            raise BadInput("it has no rotation, or statistics of other sensors than its layout's")
        record = ModelRecord(
            model_id(artifact), model.subject, model.layout.name, model.method, model.parent,
            _facts(model, ()), now(),
        )  # fmt: skip
        model_in_full(record, False, model)
        check_servable(model)
        FrameExplainer(model).frame(0.0, readings, {}, "")
    except (DamagedArtifact, BadInput) as error:
        raise BadInput(f"no model was imported: {error}") from error
    except ValidationError as error:
        place = ".".join(map(str, error.errors()[0]["loc"]))
        raise BadInput(f"no model was imported: {place} is not what it should be") from error
    except (ValueError, IndexError, KeyError, TypeError, AttributeError, np.linalg.LinAlgError) as error:
        raise BadInput("no model was imported: it does not predict a frame of its own layout") from error
    return model


def _layout_is_new(parts: Parts, model: CalibrationModel) -> bool:
    """Raises Conflict for another layout of the same name."""
    try:
        here = parts.store.layouts.get(model.layout.name)
    except NotFound:
        return True
    if here.sensors != model.layout.sensors or set(here.rotations) < set(model.rotation_names):
        raise Conflict(
            f"layout {model.layout.name!r} has other sensors or rotations here than in the model; "
            "one of the two needs another name"
        )
    return False


def _facts(model: CalibrationModel, takes: Sequence[TakeRecord]) -> dict[str, Any]:
    """What lists of models show. ``takes``: the subject's; those it was trained on are known by hash."""
    estimate = model.error_estimate
    own = [record for record in takes if record.artifact in model.takes]
    here = f"{len(own)} of them are here" if own else "none of them is here"
    return {
        "takes": [{"id": record.id, "name": record.name, "artifact": record.artifact} for record in own],
        "held_out_rmse_deg": estimate.get("rmse_deg"),
        "rmse_unseen_wearing_deg": estimate.get("rmse_unseen_wearing_deg"),
        "held_out_how": estimate.get("how"),
        "per_rotation": {item.rotation: item.held_out_rmse_deg for item in model.rotations},
        "sentences": [f"Imported. It was trained on {len(model.takes)} takes; {here}."],
        "simulated": model.simulated,
    }
