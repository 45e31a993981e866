"""The export formats there are, by the end of a file's name."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import PurePath

from glovecal_models.errors import BadInput
from glovecal_models.installation import not_installed
from glovecal_service.exports.bvh import FORMAT as BVH
from glovecal_service.exports.c3d import FORMAT as C3D
from glovecal_service.exports.fbx import FORMAT as FBX
from glovecal_service.exports.gltf import FORMAT as GLTF
from glovecal_service.exports.hand_motion import Content, ExportFormat
from glovecal_service.exports.marker_tables import CSV, PARQUET, TRC
from glovecal_service.exports.mcap import FORMAT as MCAP
from glovecal_service.exports.usd import FORMAT as USD

KINDS = (TRC, BVH, GLTF, FBX, USD, C3D, MCAP, CSV, PARQUET)
FORMATS: dict[str, ExportFormat] = {one.suffix: one for one in KINDS}


def require_possible(chosen: ExportFormat, content: Content) -> None:
    """Raises BadInput, which names the formats that can hold ``content``, or what is not installed."""
    if chosen.needs is not None and find_spec(chosen.needs[0]) is None:
        raise BadInput(not_installed(f"a {chosen.suffix} file", chosen.needs[1]))
    if content not in chosen.contents:
        able = ", ".join(suffix for suffix, one in FORMATS.items() if content in one.contents)
        raise BadInput(f"{chosen.suffix} cannot hold {content}; {able} can")


def format_of(name: str) -> ExportFormat:
    """By a file's name. Raises BadInput that lists what there is."""
    suffix = PurePath(name).suffix.lower()
    if suffix not in FORMATS:
        raise BadInput(f"{name!r} must end in {', '.join(FORMATS)}: these are the formats of an export")
    return FORMATS[suffix]
