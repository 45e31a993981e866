"""``uploads``: a file of an import that needs two."""

from __future__ import annotations

from fastapi import APIRouter, Request
from pydantic import BaseModel, Field

from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import PartsNeeded
from glovecal_service.rest.take.table_upload import TABLE_BODY, keep_table

router = APIRouter(prefix="/uploads", tags=["takes"])


class UploadedFile(BaseModel):
    sha256: str = Field(description="The name to give where an upload is asked for.")
    size: int = Field(description="Bytes.")


@router.post(
    "",
    status_code=201,
    response_model=UploadedFile,
    summary="Send a reference table",
    responses=change_problems(415),
    openapi_extra=TABLE_BODY,
)
async def add_upload(request: Request, parts: PartsNeeded) -> UploadedFile:
    """Keeps the bytes; sending them again changes nothing. Import it with `reference_upload` of `takes`."""
    upload = await keep_table(request, parts)
    return UploadedFile(sha256=upload.sha256, size=upload.size)
