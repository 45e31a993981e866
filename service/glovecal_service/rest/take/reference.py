"""``takes/{id}/reference``: angles measured by another computer, from its clock to the take's."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import anyio.to_thread
import numpy as np
from fastapi import APIRouter, Query, Request

from glovecal_models.errors import BadInput
from glovecal_models.takes.angles_on_a_circle import unwrapped
from glovecal_models.takes.camera_estimates import read_estimates
from glovecal_models.takes.camera_reference import CAMERA_PATCHES, reference_from_camera
from glovecal_models.takes.table import read_reference
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.problem import Problem, change_problems
from glovecal_service.rest.http.request_types import IdInPath
from glovecal_service.rest.take.answer import CameraReferenceView, Take
from glovecal_service.rest.take.uploads import TABLE_BODY, FileName, file_name, keep_table
from glovecal_service.store.records import TakeRecord
from glovecal_service.store.takes import CAMERA_REFERENCE, UNWRAPPED

router = APIRouter(prefix="/takes", tags=["takes"])
ESTIMATES_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
    }
}

ReferenceClock = Literal["take", "wall"]
"""``take``: seconds as in the take's own ``time_s``; ``wall``: Unix seconds."""


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
    time_s = _on_take_clock(rows.time_s, clock, record)
    take = replace(
        parts.store.takes.load_recorded(id),
        reference_time_s=time_s,
        rotations=rows.rotations,
        reference=rows.reference,
        reference_sd=rows.reference_sd,
    )
    circle = unwrapped([take])
    return parts.store.takes.attach_reference(
        id, time_s, rows.rotations, circle.takes[0].reference, rows.poses, reference_sd=rows.reference_sd,
        facts={UNWRAPPED: list(circle.sentences)} if circle.sentences else None,
    )  # fmt: skip


def _on_take_clock(time_s: np.ndarray, clock: ReferenceClock, record: TakeRecord) -> np.ndarray:
    """``time_s`` (N,) in the take's own seconds. Raises Problem 409 for a take without a wall clock."""
    if clock == "take":
        return time_s
    offset = (record.accounting or {}).get("wall_minus_time_s")
    if not isinstance(offset, int | float):
        raise Problem(
            409,
            "no-wall-clock",
            f"take {record.id} ({record.name!r}) does not know when it was recorded; only takes recorded by "
            "the service do. Give the reference in the take's own time_s with clock=take.",
        )
    return time_s - float(offset)


@router.put(
    "/{id}/camera-reference",
    response_model=CameraReferenceView,
    summary="Attach what a camera measured as the reference",
    responses=change_problems(409, 415),
    openapi_extra=ESTIMATES_BODY,
)
async def put_camera_reference(
    id: IdInPath,
    request: Request,
    parts: PartsNeeded,
    near_s: Annotated[
        float, Query(ge=-1e11, le=1e11, description="Camera time less glove time, about; seconds.")
    ] = 0.0,
    within_s: Annotated[
        float, Query(gt=0, le=30.0, description="How far it is searched on both sides.")
    ] = 3.0,
    filename: FileName = "estimates.npz",
) -> CameraReferenceView:
    """The body is a file of a camera's estimates (.npz). Its clock is found by the movement, and only what
    the camera accepted becomes the reference, each angle with its standard deviation. The reference that was
    there stays on file; where the clock is not found nothing is changed."""
    await asyncio.to_thread(parts.store.takes.get, id)
    upload = await keep_table(request, parts)
    search = (near_s, within_s)
    named = (filename, upload.path)
    return await anyio.to_thread.run_sync(
        _attach_camera, parts, id, named, search, limiter=parts.import_slots
    )


def _attach_camera(
    parts: Parts, id: str, named: tuple[str, Path], search: tuple[float, float]
) -> CameraReferenceView:
    with parts.uploads.under_names(named) as (path,):
        estimates = read_estimates(path)
    take = parts.store.takes.load_recorded(id)
    if estimates.simulated and not take.simulated:
        raise BadInput(f"{named[0]} was simulated or rendered; take {take.name!r} was recorded")
    found = reference_from_camera(take, estimates, near_s=search[0], within_s=search[1])
    seen, document = found.take, found.to_document()
    patches = {name: seen.context[name] for name in seen.context if name == CAMERA_PATCHES}
    record = parts.store.takes.attach_reference(
        id, seen.reference_time_s, seen.rotations, seen.reference,
        reference_sd=seen.reference_sd, context=patches, facts={CAMERA_REFERENCE: document},
    )  # fmt: skip
    return CameraReferenceView(
        **{name: document[name] for name in ("clock_offset_s", "clock_offset_sd_s", "accepted_share")},
        take=Take.model_validate(record, from_attributes=True),
        camera_ranges=list(found.ranges),
        sentences=found.sentences(),
    )
