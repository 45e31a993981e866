"""``uploads``: take tables as request bodies, and the one that an import of two tables needs first."""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Request

from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.problem import Problem, change_problems
from glovecal_service.rest.http.upload_folder import Upload
from glovecal_service.rest.take.answer import UploadedFile

router = APIRouter(prefix="/uploads", tags=["takes"])

TableFormat = Literal["csv", "parquet"]
MEDIA_TYPES: dict[TableFormat, str] = {"csv": "text/csv", "parquet": "application/vnd.apache.parquet"}
ACCEPTED = (*MEDIA_TYPES.values(), "application/octet-stream")
LONGEST_FILE_NAME = 200

FILE_NAME = r"^[^./\\\x00-\x1f\x7f][^/\\\x00-\x1f\x7f]*$"
FileName = Annotated[
    str,
    Query(
        pattern=FILE_NAME,
        max_length=LONGEST_FILE_NAME,
        description="What the user calls the file: errors say it, an unnamed take is named after it.",
    ),
]
TABLE_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {kind: {"schema": {"type": "string", "format": "binary"}} for kind in ACCEPTED},
    }
}
"""``openapi_extra`` of an operation whose body is a take table."""


async def keep_table(request: Request, parts: Parts) -> Upload:
    """The body, kept whole under its sha256 before anyone reads it. Raises Problem 415, StorageFull."""
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind not in ACCEPTED:
        raise Problem(
            415, "media-type", f"a take table is sent as {' or '.join(ACCEPTED)}, not {kind or 'nothing'!r}"
        )
    upload = await parts.uploads.receive(request.stream())
    if upload.is_new:
        parts.metrics.uploaded_bytes.inc(upload.size)
    return upload


def file_name(name: str, table_format: TableFormat | None) -> str:
    """``name`` with the ending of its format, short enough for a file system. Raises Problem 422."""
    known = PurePosixPath(name).suffix.lower() in (".csv", ".parquet")
    if table_format is not None and not name.lower().endswith(f".{table_format}"):
        name = f"{name}.{table_format}"
    elif not known:
        name = f"{name}.csv" if table_format is None else name
    if len(name.encode("utf-8", "replace")) > LONGEST_FILE_NAME + 10:
        raise Problem(422, "invalid-request", "the file name is too long; give at most 200 bytes")
    return name


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
