"""Files that were sent to `uploads`, as requests name them, and how those are read."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field

from glovecal_models.hand.rotations import Handedness
from glovecal_models.takes.answer import ColumnMapping
from glovecal_models.takes.table_preview import foreign_mapping
from glovecal_service.exports.motion_files.formats import motion_format
from glovecal_service.exports.motion_files.reference_file import (
    ReferenceFile,
    read_reference_file,
    without_readings,
)
from glovecal_service.plain import read
from glovecal_service.request_types import SHA256
from glovecal_service.rest.http.dependencies import Parts
from glovecal_service.rest.http.problem import Problem
from glovecal_service.rest.take.uploads import FILE_NAME, LONGEST_FILE_NAME
from glovecal_service.store.list_part import ListPart
from glovecal_service.store.store import Store

READ_AS = "read_as"
"""In a take's facts: the shape of the table it came from, and how that was read."""


class Uploaded(BaseModel):
    """A file that was sent to `uploads`."""

    model_config = ConfigDict(extra="forbid")  # strict would take no list as columns

    upload: str = Field(pattern=SHA256)
    filename: str = Field(
        pattern=FILE_NAME, max_length=LONGEST_FILE_NAME, description="What the user calls it."
    )


class UploadedReadings(Uploaded):
    mapping: ColumnMapping | None = Field(
        None,
        description="How it is read. None: as a take table, else as it was guessed or kept.",
    )


class UploadedReference(UploadedReadings):
    """A table with angles and no readings, or a motion file (TRC, BVH)."""

    hand: Handedness | None = Field(None, description="Of a motion file; None: as its names say.")


def kept_upload(parts: Parts, upload: str) -> Path:
    """Raises Problem 404."""
    path = parts.uploads.find(upload)
    if path is None:
        raise Problem(404, "not-found", f"there is no upload {upload}; send the file to uploads first")
    return path


def read_uploaded(parts: Parts, body: UploadedReference, hand: Handedness | None = None) -> ReferenceFile:
    """``hand``: which is read where ``body`` does not say it. Raises Problem, BadInput."""
    path = kept_upload(parts, body.upload)
    with parts.uploads.under_names((body.filename, path)) as [named]:
        mapping = body.mapping
        if mapping is None and motion_format(named) is None:
            mapping = foreign_mapping(named, partial(mapping_kept, parts.store))
        return read_reference_file(
            named, None if mapping is None else without_readings(mapping), body.hand or hand
        )


def mapping_kept(store: Store, shape: str) -> ColumnMapping | None:
    """As a table of this shape was read last."""
    for record in store.takes.list(part=ListPart(reverse=True, text=shape)):
        kept = record.facts.get(READ_AS)
        if kept is not None and kept["shape"] == shape:
            return read(ColumnMapping, kept["mapping"])
    return None
