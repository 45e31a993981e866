"""``takes``: recordings with or without reference angles."""

from __future__ import annotations

import asyncio
import tempfile
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, Literal

import anyio.to_thread
from fastapi import APIRouter, Query, Request, Response
from fastapi.responses import FileResponse
from pydantic import BaseModel, Field
from starlette.background import BackgroundTask

from glovecal_models.takes.table import read_reference, read_takes
from glovecal_models.takes.take import Take as TakeArrays
from glovecal_models.takes.take_check import check_take
from glovecal_models.takes.write_table import write_takes
from glovecal_service.plain import plain
from glovecal_service.rest.answers import change_problems, problems
from glovecal_service.rest.damaged_rows import without_damaged
from glovecal_service.rest.dependencies import Parts, PartsNeeded, StoreNeeded
from glovecal_service.rest.names import (
    IDENTIFIER,
    SHA256,
    Identifier,
    IdInPath,
    LayoutFilter,
    SubjectFilter,
    SubjectName,
    WearingName,
)
from glovecal_service.rest.problem import Problem
from glovecal_service.rest.reference_clock import ReferenceClock, on_take_clock
from glovecal_service.rest.strict_body import StrictBody
from glovecal_service.rest.table_upload import (
    MEDIA_TYPES,
    TABLE_BODY,
    FileName,
    TableFormat,
    file_name,
    keep_table,
)
from glovecal_service.rest.take_import import Import, import_takes
from glovecal_service.store.records import TakeRecord, incomplete_sentences

router = APIRouter(prefix="/takes", tags=["takes"])


class Take(BaseModel):
    id: str
    name: str
    subject: str
    layout: str
    wearing: str
    source: str
    artifact: str = Field(description="sha256 of the stored arrays.")
    original_sha256: str | None = Field(description="sha256 of the uploaded file, which is kept.")
    sensors: list[str]
    rotations: list[str] = Field(description="Rotations with a reference.")
    context: list[str]
    frames: int
    reference_rows: int
    teaches: bool = Field(description="Whether a calibration can learn from it.")
    duration_s: float
    simulated: bool
    recording: str | None
    state: Literal["complete", "repairing"] = Field(
        description="`repairing`: frames of its recording may still be fetched from the capture log."
    )
    accounting: dict[str, Any] | None
    facts: dict[str, Any]
    created_at: datetime | None


class SensorRangeView(BaseModel):
    sensor: str
    low: float
    high: float
    changed: float = Field(description="Share of frames whose reading differs from the one before.")


class RotationRangeView(BaseModel):
    rotation: str
    rows: int = Field(description="Reference rows that have it.")
    low_deg: float
    high_deg: float


class CheckView(BaseModel):
    take: Take
    rate_hz: float | None = Field(description="By the median interval between frames.")
    gaps: int = Field(description="Intervals in which frames are missing.")
    longest_interval_s: float | None
    repeated_frames: float = Field(description="Share of frames that are the same as the one before.")
    frames_with_reference: float = Field(
        description="Share of frames with at least one reference angle; the lead-in is not counted."
    )
    lead_in_frames: int = Field(description="Frames before the take was asked for.")
    lead_in_s: float
    sensors: list[SensorRangeView]
    rotations: list[RotationRangeView]
    sentences: list[str] = Field(description="What looks wrong.")


class ImportedTakes(BaseModel):
    takes: list[Take] = Field(description="All takes of the file, in its order.")
    imported: list[str] = Field(description="Ids of those that are new.")
    existing: list[str] = Field(description="Ids of those that the same file had brought before.")
    layout: str
    original_sha256: str
    warnings: list[str] = Field(description="What `check` says of the takes; like sentences once.")
    subject_created: bool = Field(description="Whether the subject was not there before.")


class ImportOptions(BaseModel):
    """Query parameters of an import."""

    subject: SubjectName
    create_subject: bool = Field(False, description="Add the subject if it is not there; else 404.")
    layout: str | None = Field(None, pattern=IDENTIFIER, description="None: made of the file's columns.")
    format: TableFormat | None = Field(None, description="None: by the file's first bytes and name.")
    name: WearingName | None = Field(None, description="Name of the take; before the names of several.")
    wearing: WearingName | None = Field(None, description="The wearing, where the file does not say it.")
    equal_times: Literal["refuse", "spread"] = Field("refuse", description="Frames stamped in batches.")
    reference_upload: str | None = Field(
        None, pattern=SHA256, description="A reference table sent before to `uploads`."
    )


@router.post(
    "",
    status_code=201,
    response_model=ImportedTakes,
    summary="Import a take table",
    responses=change_problems(409, 415)
    | {200: {"model": ImportedTakes, "description": "Every take of this file was here already."}},
    openapi_extra=TABLE_BODY,
)
async def add_takes(
    request: Request,
    response: Response,
    parts: PartsNeeded,
    options: Annotated[ImportOptions, Query()],
    filename: FileName = "upload",
    reference_filename: FileName = "reference",
) -> dict[str, Any]:
    """The body is the file itself (CSV or Parquet), kept as it came before it is read.

    All takes of the file are imported or none. Sending the same file again for the same subject answers
    200 with the takes there are; for another subject 409. A reference table of its own goes to `uploads`
    first and is named here by its sha256.
    """
    upload = await keep_table(request, parts)
    files = [(file_name(filename, options.format), upload.path)]
    if options.reference_upload is not None:
        found = parts.uploads.find(options.reference_upload)
        if found is None:
            raise Problem(404, "not-found", f"there is no upload {options.reference_upload}")
        files.append((file_name(reference_filename, None), found))
    result = await anyio.to_thread.run_sync(
        _import, parts, files, upload.sha256, options, limiter=parts.import_slots
    )
    parts.metrics.imported_takes.inc(len(result.imported))
    response.status_code = 201 if result.imported else 200
    return {
        "takes": result.takes,
        "imported": result.imported,
        "existing": sorted(result.existing),
        "layout": result.layout,
        "original_sha256": upload.sha256,
        "subject_created": result.subject_created,
        "warnings": result.warnings,
    }


@router.get("", response_model=list[Take], summary="Takes, oldest first", responses=problems())
def list_takes(
    store: StoreNeeded, response: Response, subject: SubjectFilter = None, layout: LayoutFilter = None
) -> list[TakeRecord]:
    """Damaged rows are left out and named in `Warning` headers."""
    return without_damaged(response, lambda: store.takes.list(subject=subject, layout=layout))


@router.get("/{id}", response_model=Take, summary="One take", responses=problems())
def get_take(id: IdInPath, store: StoreNeeded) -> TakeRecord:
    return store.takes.get(id)


@router.get(
    "/{id}/check",
    response_model=CheckView,
    summary="How regular a take is, what was measured, what looks wrong",
    responses=problems(),
)
def check_one_take(id: IdInPath, store: StoreNeeded) -> dict[str, Any]:
    record = store.takes.get(id)
    found = plain(asdict(check_take(store.takes.load(id))))
    return {"take": record, **found, "sentences": [*incomplete_sentences([record]), *found["sentences"]]}


class TakeLayout(StrictBody):
    layout: Identifier


@router.put(
    "/{id}/layout",
    response_model=Take,
    summary="Read a take's rotations by another layout",
    responses=change_problems(),
)
def put_layout(id: IdInPath, body: TakeLayout, store: StoreNeeded) -> TakeRecord:
    """Frames and reference stay as they are; models that were trained on the take stay what they are. 422
    when the take lacks a sensor of the layout."""
    return store.takes.use_layout(id, store.layouts.get(body.layout))


@router.delete(
    "/{id}",
    status_code=204,
    response_class=Response,
    summary="Remove a take",
    responses=change_problems(409),
)
def remove_take(id: IdInPath, store: StoreNeeded) -> None:
    """409 when a model was trained on it. The uploaded file stays."""
    store.takes.remove(id)


@router.put(
    "/{id}/reference",
    response_model=Take,
    summary="Attach reference angles",
    responses=change_problems(409, 415),
    openapi_extra=TABLE_BODY,
)
async def put_reference(
    id: IdInPath,
    request: Request,
    parts: PartsNeeded,
    clock: Annotated[ReferenceClock, Query(description="What `time_s` of the table counts.")] = "take",
    filename: FileName = "reference",
) -> TakeRecord:
    """The body is a table with `time_s` and `r.` columns; the reference that was there stays on file."""
    await asyncio.to_thread(parts.store.takes.get, id)
    upload = await keep_table(request, parts)
    named = (file_name(filename, None), upload.path)
    return await anyio.to_thread.run_sync(_attach, parts, id, named, clock, limiter=parts.import_slots)


@router.get(
    "/{id}/export",
    response_class=FileResponse,
    summary="A take as a table",
    responses=problems(409)
    | {
        200: {
            "description": "A take table.",
            "content": {
                kind: {"schema": {"type": "string", "format": "binary"}} for kind in MEDIA_TYPES.values()
            },
        }
    },
)
def export_take(
    id: IdInPath,
    store: StoreNeeded,
    format: TableFormat = "csv",
    part: Literal["all", "frames", "reference"] = "all",
) -> FileResponse:
    """A take whose reference has a clock of its own is two tables: ask for each `part` (409 for `all`)."""
    take = store.takes.load(id)
    folder = tempfile.TemporaryDirectory(prefix="glovecal-export-")
    try:
        path = _chosen_part(write_takes([take], Path(folder.name) / f"{id}.{format}"), part, take)
    except BaseException:
        folder.cleanup()
        raise
    return FileResponse(
        path, media_type=MEDIA_TYPES[format], filename=path.name, background=BackgroundTask(folder.cleanup)
    )


def _import(
    parts: Parts, files: list[tuple[str, Path]], original_sha256: str, options: ImportOptions
) -> Import:
    with parts.uploads.under_names(*files) as paths:

        def read() -> list[TakeArrays]:
            return read_takes(
                *paths, name=options.name, wearing=options.wearing, equal_times=options.equal_times
            )

        return import_takes(
            parts.store,
            read,
            original_sha256=original_sha256,
            subject=options.subject,
            layout=options.layout,
            create_subject=options.create_subject,
        )


def _attach(parts: Parts, id: str, named: tuple[str, Path], clock: ReferenceClock) -> TakeRecord:
    record = parts.store.takes.get(id)
    with parts.uploads.under_names(named) as (path,):
        references = read_reference(path)
    rows = references.get(record.name) or references.get(None)
    if rows is None and len(references) == 1:
        rows = next(iter(references.values()))
    if rows is None:
        raise Problem(
            422, "bad-take-table", f"{path.name} holds no rows for take {record.name!r}", file=path.name
        )
    time_s = on_take_clock(rows.time_s, clock, record)
    return parts.store.takes.attach_reference(id, time_s, rows.rotations, rows.reference, rows.poses)


def _chosen_part(written: list[Path], part: str, take: TakeArrays) -> Path:
    if len(written) == 1:
        if part == "reference":
            raise Problem(409, "conflict", f"take {take.name!r} is one table; ask for part=all")
        return written[0]
    if part == "all":
        raise Problem(
            409,
            "conflict",
            "this take's reference has a clock of its own: ask for part=frames and part=reference",
        )
    return written[0] if part == "frames" else written[1]
