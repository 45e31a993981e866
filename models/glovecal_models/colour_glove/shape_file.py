"""A hand's shape as a file: lengths and radii in mm, as ``glovecal camera shape`` finds them. JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from glovecal_models.colour_glove.skin import RADII_MM, HandSkin, hand_skin
from glovecal_models.documents import read_json
from glovecal_models.errors import BadInput
from glovecal_models.hand.dimensions import DIMENSIONS, HandDimensions
from glovecal_models.hand.handedness import Handedness
from glovecal_models.hand.skeleton import hand_skeleton

FORMAT = "glovecal hand shape 1"
LARGEST_SHAPE_FILE = 100_000


@dataclass(frozen=True)
class ShapeOnFile:
    hand: Handedness
    sizes_mm: Mapping[str, float]
    """All of ``DIMENSIONS``."""
    radii_mm: Mapping[str, tuple[float, float]]
    """All of ``RADII_MM``."""
    size_sd: float
    """Relative standard deviation of the whole hand's size."""
    bones_sd: Mapping[str, float]
    """Relative, of the bones' lengths."""

    def skin(self) -> HandSkin:
        """Raises BadInput for sizes that no hand has."""
        return hand_skin(
            hand_skeleton(HandDimensions.from_measured(self.sizes_mm), self.hand), dict(self.radii_mm)
        )


def write_shape(file: Path, shape: ShapeOnFile) -> None:
    """Whole or not at all."""
    document = {"format": FORMAT, **vars(shape)}
    unfinished = file.with_name(f".{file.name}.part")
    unfinished.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    unfinished.replace(file)


def read_shape(file: Path) -> ShapeOnFile:
    """Raises BadInput that names the file, OSError."""
    size = file.stat().st_size
    if size > LARGEST_SHAPE_FILE:
        raise BadInput(f"{file}: {size} bytes; a hand's shape takes at most {LARGEST_SHAPE_FILE}")
    document = read_json(file.read_bytes(), str(file))
    wanted = {"format", *ShapeOnFile.__dataclass_fields__}
    if not isinstance(document, dict) or set(document) != wanted or document.pop("format") != FORMAT:
        raise BadInput(f"{file} is no hand's shape: expected {FORMAT!r} and {', '.join(sorted(wanted))}")
    if document["hand"] not in ("right", "left"):
        raise BadInput(f"{file}: hand is {document['hand']!r}, expected right or left")
    sizes = _numbers(file, "sizes_mm", document["sizes_mm"], DIMENSIONS)
    radii = document["radii_mm"]
    if not isinstance(radii, dict) or any(
        not isinstance(ends, list) or len(ends) != 2 for ends in radii.values()
    ):
        raise BadInput(f"{file}: radii_mm must hold two numbers for each of {', '.join(RADII_MM)}")
    first, last = (
        _numbers(file, "radii_mm", {name: ends[end] for name, ends in radii.items()}, tuple(RADII_MM))
        for end in (0, 1)
    )
    known = {name: (first[name], last[name]) for name in first}
    bones = _numbers(file, "bones_sd", document["bones_sd"], None)
    size_sd = _numbers(file, "size_sd", {"size_sd": document["size_sd"]}, None)["size_sd"]
    found = ShapeOnFile(document["hand"], sizes, known, size_sd, bones)
    found.skin()
    return found


def _is_pair(ends: object) -> bool:
    return isinstance(ends, list) and len(ends) == 2


def _numbers(file: Path, what: str, given: object, names: tuple[str, ...] | None) -> dict[str, float]:
    if not isinstance(given, dict) or (names is not None and set(given) != set(names)):
        raise BadInput(f"{file}: {what} must name {', '.join(names or ('numbers',))}, nothing else")
    for name, value in given.items():
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not math.isfinite(value)
            or value <= 0
        ):
            raise BadInput(f"{file}: {name} of {what} is {value!r}; a number above 0 is expected")
    return {str(name): float(value) for name, value in given.items()}
