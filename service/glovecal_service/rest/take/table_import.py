"""``POST takes``: a take table is imported, all takes of the file or none."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import anyio.to_thread
from fastapi import APIRouter, Query, Request, Response
from pydantic import BaseModel, Field

from glovecal_models.takes.table import read_takes
from glovecal_models.takes.take import Take as TakeArrays
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.problem import Problem
from glovecal_service.rest.http.request_types import IDENTIFIER, SHA256, SubjectName, WearingName
from glovecal_service.rest.take.import_takes import Import, import_takes
from glovecal_service.rest.take.takes import Take
from glovecal_service.rest.take.uploads import TABLE_BODY, FileName, TableFormat, file_name, keep_table

router = APIRouter(prefix="/takes", tags=["takes"])


class ImportedTakes(BaseModel):
    takes: list[Take] = Field(description="All takes of the file, in its order.")
    imported: list[str] = Field(description="Ids of those that are new.")
    existing: list[str] = Field(description="Ids of those that the same file had brought before.")
    replaced: list[str] = Field(description="Ids of those whose reference and names are now the file's.")
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
    replace: bool = Field(
        False, description="Takes whose frames are here get the file's reference and names; else 409."
    )
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
    response.status_code = 201 if result.imported or result.replaced else 200
    return {
        "takes": result.takes,
        "imported": result.imported,
        "existing": sorted(result.existing),
        "replaced": sorted(result.replaced),
        "layout": result.layout,
        "original_sha256": upload.sha256,
        "subject_created": result.subject_created,
        "warnings": result.warnings,
    }


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
            replace=options.replace,
        )
