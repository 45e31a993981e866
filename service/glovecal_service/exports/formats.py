"""The export formats there are, by the end of a file's name."""

from __future__ import annotations

from pathlib import PurePath

from glovecal_models.errors import BadInput
from glovecal_service.exports.bvh import FORMAT as BVH
from glovecal_service.exports.fbx import FORMAT as FBX
from glovecal_service.exports.gltf import FORMAT as GLTF
from glovecal_service.exports.hand_motion import Content, ExportFormat
from glovecal_service.exports.marker_tables import CSV, PARQUET, TRC
from glovecal_service.exports.usd import FORMAT as USD

FORMATS: dict[str, ExportFormat] = {one.suffix: one for one in (TRC, BVH, GLTF, FBX, USD, CSV, PARQUET)}


def require_held(chosen: ExportFormat, content: Content) -> None:
    """Raises BadInput, which names the formats that can hold ``content``."""
    if content not in chosen.contents:
        able = ", ".join(suffix for suffix, one in FORMATS.items() if content in one.contents)
        raise BadInput(f"{chosen.suffix} cannot hold {content}; {able} can")


def format_of(name: str) -> ExportFormat:
    """By a file's name. Raises BadInput that lists what there is."""
    suffix = PurePath(name).suffix.lower()
    if suffix not in FORMATS:
        raise BadInput(f"{name!r} must end in {', '.join(FORMATS)}: these are the formats of an export")
    return FORMATS[suffix]
