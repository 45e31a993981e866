"""A table is imported, all takes of the file or none; before that it is shown what would be made of it."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import anyio.to_thread
from fastapi import APIRouter, Query, Request, Response
from pydantic import BaseModel, Field

from glovecal_models.takes.answer import ColumnMapping, TablePreview
from glovecal_models.takes.joined_reference import join_references
from glovecal_models.takes.table import read_takes
from glovecal_models.takes.table_preview import preview_table
from glovecal_models.takes.take import Take as TakeArrays
from glovecal_service.plain import document_of
from glovecal_service.request_types import IDENTIFIER, SHA256, SubjectName, WearingName
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.problem import change_problems
from glovecal_service.rest.take.answer import ImportedTakes
from glovecal_service.rest.take.import_takes import Import, import_takes
from glovecal_service.rest.take.uploaded_files import (
    READ_AS,
    UploadedReadings,
    UploadedReference,
    kept_upload,
    mapping_kept,
    read_uploaded,
)
from glovecal_service.rest.take.uploads import (
    TABLE_BODY,
    FileName,
    TableFormat,
    file_name,
    keep_table,
)

router = APIRouter(prefix="/takes", tags=["takes"])

MOST_REFERENCES = 200


class ImportedAs(BaseModel):
    """Whose takes they are, and how they are called."""

    subject: SubjectName
    create_subject: bool = Field(False, description="Add the subject if it is not there; else 404.")
    layout: str | None = Field(None, pattern=IDENTIFIER, description="None: made of the file's columns.")
    name: WearingName | None = Field(None, description="Name of the take; before the names of several.")
    wearing: WearingName | None = Field(None, description="The wearing, where the file does not say it.")
    equal_times: Literal["refuse", "spread"] = Field("refuse", description="Frames stamped in batches.")
    replace: bool = Field(
        False, description="Takes whose frames are here get the file's reference and names; else 409."
    )


class ImportOptions(ImportedAs):
    """Query parameters of an import."""

    format: TableFormat | None = Field(None, description="None: by the file's first bytes and name.")
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
        reference = await asyncio.to_thread(kept_upload, parts, options.reference_upload)
        files.append((file_name(reference_filename, None), reference))
    return await _imported(parts, response, files, upload.sha256, options)


class UploadedTable(UploadedReadings):
    """A table that was sent to `uploads`, and files with the angles that belong to it."""

    wearing: WearingName | None = Field(None, description="The wearing, where the file does not say it.")
    references: list[UploadedReference] = Field(
        default_factory=list, max_length=MOST_REFERENCES,
        description="Files with the angles of its takes: each take is joined with the one that fits.",
    )  # fmt: skip


class ImportedUpload(ImportedAs, UploadedTable):
    pass


@router.post(
    "/preview",
    response_model=TablePreview,
    summary="What a table would become",
    responses=change_problems(),
)
async def preview(body: UploadedTable, parts: PartsNeeded) -> TablePreview:
    """Nothing is imported. A table of a shape that was imported before is read as it was then; 422 for what
    is no table of numbers."""

    def look() -> TablePreview:
        path = kept_upload(parts, body.upload)
        references = [read_uploaded(parts, each).rows for each in body.references]
        with parts.uploads.under_names((body.filename, path)) as [named]:
            return preview_table(
                named, body.mapping, wearing=body.wearing, kept=partial(mapping_kept, parts.store),
                references=references,
            )  # fmt: skip

    return await anyio.to_thread.run_sync(look, limiter=parts.import_slots)


@router.post(
    "/import",
    status_code=201,
    response_model=ImportedTakes,
    summary="Import a table as its preview showed it",
    responses=change_problems(409)
    | {200: {"model": ImportedTakes, "description": "Every take of this file was here already."}},
)
async def import_upload(body: ImportedUpload, response: Response, parts: PartsNeeded) -> dict[str, Any]:
    """As `POST /v1/takes` does with a take table. How it was read is kept for the next file of its shape."""
    files = [(body.filename, await asyncio.to_thread(kept_upload, parts, body.upload))]
    return await _imported(parts, response, files, body.upload, body, body.mapping, body.references)


async def _imported(
    parts: Parts,
    response: Response,
    files: list[tuple[str, Path]],
    original_sha256: str,
    options: ImportedAs,
    mapping: ColumnMapping | None = None,
    references: Sequence[UploadedReference] = (),
) -> dict[str, Any]:
    result = await anyio.to_thread.run_sync(
        _import, parts, files, original_sha256, options, mapping, references, limiter=parts.import_slots
    )
    parts.metrics.imported_takes.inc(len(result.imported))
    response.status_code = 201 if result.imported or result.replaced else 200
    return {
        "takes": result.takes,
        "imported": result.imported,
        "existing": sorted(result.existing),
        "replaced": sorted(result.replaced),
        "layout": result.layout,
        "original_sha256": original_sha256,
        "subject_created": result.subject_created,
        "warnings": result.warnings,
    }


def _import(
    parts: Parts,
    files: list[tuple[str, Path]],
    original_sha256: str,
    options: ImportedAs,
    mapping: ColumnMapping | None,
    references: Sequence[UploadedReference],
) -> Import:
    facts = None
    if mapping is not None:
        facts = {READ_AS: {"shape": mapping.shape, "mapping": document_of(mapping)}}
    with parts.uploads.under_names(*files) as paths:

        def takes() -> list[TakeArrays]:
            readings = read_takes(
                *paths, name=options.name, wearing=options.wearing, equal_times=options.equal_times,
                mapping=mapping,
            )  # fmt: skip
            if not references:
                return readings
            rows = [read_uploaded(parts, each).rows for each in references]
            return [each.take for each in join_references(readings, rows)]

        return import_takes(
            parts.store,
            takes,
            original_sha256=original_sha256,
            subject=options.subject,
            layout=options.layout,
            create_subject=options.create_subject,
            replace=options.replace,
            facts=facts,
        )
