"""``takes/{id}/reference``: angles measured by another computer, from its clock to the take's."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Annotated, Literal

import anyio.to_thread
import numpy as np
from fastapi import APIRouter, Query, Request

from glovecal_models.takes.table import read_reference
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.problem import Problem
from glovecal_service.rest.http.request_types import IdInPath
from glovecal_service.rest.take.takes import Take
from glovecal_service.rest.take.uploads import TABLE_BODY, FileName, file_name, keep_table
from glovecal_service.store.records import TakeRecord

router = APIRouter(prefix="/takes", tags=["takes"])

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
    return parts.store.takes.attach_reference(
        id, time_s, rows.rotations, rows.reference, rows.poses, reference_sd=rows.reference_sd
    )


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
