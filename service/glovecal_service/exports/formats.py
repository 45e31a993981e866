"""The export formats there are, by the end of a file's name."""

from __future__ import annotations

from pathlib import PurePath

from glovecal_models.errors import BadInput
from glovecal_service.exports.bvh import FORMAT as BVH
from glovecal_service.exports.hand_motion import ExportFormat
from glovecal_service.exports.marker_tables import CSV, PARQUET, TRC

FORMATS: dict[str, ExportFormat] = {one.suffix: one for one in (TRC, BVH, CSV, PARQUET)}


def format_of(name: str) -> ExportFormat:
    """By a file's name. Raises BadInput that lists what there is."""
    suffix = PurePath(name).suffix.lower()
    if suffix not in FORMATS:
        raise BadInput(f"{name!r} must end in {', '.join(FORMATS)}: these are the formats of an export")
    return FORMATS[suffix]
