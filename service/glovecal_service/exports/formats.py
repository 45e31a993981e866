"""The export formats there are, by the end of a file's name."""

from __future__ import annotations

from pathlib import PurePath

from glovecal_models.errors import BadInput
from glovecal_service.exports import angle_table, bvh, trc
from glovecal_service.exports.export_format import ExportFormat

FORMATS: dict[str, ExportFormat] = {
    one.suffix: one for one in (trc.FORMAT, bvh.FORMAT, angle_table.CSV, angle_table.PARQUET)
}


def format_of(name: str) -> ExportFormat:
    """By a file's name. Raises BadInput that lists what there is."""
    suffix = PurePath(name).suffix.lower()
    if suffix not in FORMATS:
        raise BadInput(f"{name!r} must end in {', '.join(FORMATS)}: these are the formats of an export")
    return FORMATS[suffix]
