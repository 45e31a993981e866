"""The shape of one hand in its glove: what a picture of it depends on beside its pose.

Bones and radii; how flesh and cloth lie aside about each bone (``skin.LAID``): no hand is the model's, and no
glove lies as it was printed, but both do so for as long as the glove is worn; and by how much the axes of the
joints are tilted, which no hand has where an atlas puts them.

As a file: JSON, as ``glovecal camera shape`` writes it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from glovecal_models.colour_glove.skin import LAID, RADII_MM, HandSkin, hand_skin
from glovecal_models.documents import read_json
from glovecal_models.errors import BadInput
from glovecal_models.hand.dimensions import DIMENSIONS, HandDimensions
from glovecal_models.hand.rotations import WRIST, Handedness
from glovecal_models.hand.skeleton import Skeleton, hand_skeleton, mirrored

TILTED = tuple(
    joint.name for joint in hand_skeleton().joints if joint.rotations and not {*joint.rotations} & {*WRIST}
)
"""Joints whose axes may be tilted."""
FORMAT = "glovecal hand shape 2"
_BONES_ALONE = "glovecal hand shape 1"
"""An earlier file: nothing lies aside, no axis is tilted."""
LARGEST_SHAPE_FILE = 100_000
MOST_ASIDE_MM, MOST_TILTED_DEG = 40.0, 45.0


@dataclass(frozen=True)
class HandShape:
    hand: Handedness
    sizes_mm: Mapping[str, float]
    """All of ``DIMENSIONS``."""
    radii_mm: Mapping[str, tuple[float, float]]
    """All of ``RADII_MM``."""
    laid_mm: Mapping[str, tuple[float, ...]]
    """Of each of ``RADII_MM``: ``LAID``. Of a left hand those of the right one, seen in a mirror."""
    tilts_deg: Mapping[str, tuple[float, ...]]
    """Of each of ``TILTED``: about the first and the second direction across the axis (``tilted``)."""
    size_sd: float
    """Relative standard deviation of the whole hand's size."""
    bones_sd: Mapping[str, float]
    """Relative, of the bones' lengths."""

    def skin(self) -> HandSkin:
        """Raises BadInput for sizes that no hand has."""
        right = tilted(hand_skeleton(HandDimensions.from_measured(self.sizes_mm)), self.tilts_deg)
        skeleton = right if self.hand == "right" else mirrored(right)
        return hand_skin(skeleton, dict(self.radii_mm), self.laid_mm)


def tilted(right: Skeleton, tilts_deg: Mapping[str, Sequence[float]]) -> Skeleton:
    """A right hand some of whose axes are tilted: towards the coordinate axis of the joint's frame that lies
    farthest from it, made square to it, and towards the direction that is square to both."""
    joints = []
    for joint in right.joints:
        if joint.name in tilts_deg:
            axis = np.array(joint.axis)
            first = np.eye(3)[np.argmin(np.abs(axis))]
            first = first - (first @ axis) * axis
            first /= np.linalg.norm(first)
            by_first, by_second = np.tan(np.radians(tilts_deg[joint.name]))
            axis = axis + by_first * first + by_second * np.cross(axis, first)
            x, y, z = (axis / np.linalg.norm(axis)).tolist()
            joint = replace(joint, axis=(x, y, z))
        joints.append(joint)
    return replace(right, joints=tuple(joints))


def write_shape(file: Path, shape: HandShape) -> None:
    """Whole or not at all."""
    document = {"format": FORMAT, **vars(shape)}
    unfinished = file.with_name(f".{file.name}.part")
    unfinished.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    unfinished.replace(file)


def read_shape(file: Path) -> HandShape:
    """Raises BadInput that names the file, OSError."""
    size = file.stat().st_size
    if size > LARGEST_SHAPE_FILE:
        raise BadInput(f"{file}: {size} bytes; a hand's shape takes at most {LARGEST_SHAPE_FILE}")
    document = read_json(file.read_bytes(), str(file))
    if isinstance(document, dict) and document.get("format") == _BONES_ALONE:
        nothing = {name: [0.0] * len(LAID) for name in RADII_MM}, {name: [0.0, 0.0] for name in TILTED}
        document = dict(zip(("laid_mm", "tilts_deg"), nothing, strict=True)) | document | {"format": FORMAT}
    wanted = {"format", *HandShape.__dataclass_fields__}
    if not isinstance(document, dict) or set(document) != wanted or document.pop("format") != FORMAT:
        raise BadInput(f"{file} is no hand's shape: expected {FORMAT!r} and {', '.join(sorted(wanted))}")
    if document["hand"] not in ("right", "left"):
        raise BadInput(f"{file}: hand is {document['hand']!r}, expected right or left")
    sizes = _numbers(file, "sizes_mm", document["sizes_mm"], DIMENSIONS)
    first, last = _rows(file, "radii_mm", document["radii_mm"], tuple(RADII_MM), 2)
    laid = _rows(file, "laid_mm", document["laid_mm"], tuple(RADII_MM), len(LAID), most=MOST_ASIDE_MM)
    tilts = _rows(file, "tilts_deg", document["tilts_deg"], TILTED, 2, most=MOST_TILTED_DEG)
    bones = _numbers(file, "bones_sd", document["bones_sd"], None)
    size_sd = _numbers(file, "size_sd", {"size_sd": document["size_sd"]}, None)["size_sd"]
    found = HandShape(
        document["hand"], sizes, {name: (first[name], last[name]) for name in first},
        {name: tuple(way[name] for way in laid) for name in RADII_MM},
        {name: tuple(way[name] for way in tilts) for name in TILTED}, size_sd, bones,
    )  # fmt: skip
    found.skin()
    return found


def _rows(
    file: Path, what: str, given: object, names: tuple[str, ...], count: int, most: float | None = None
) -> list[dict[str, float]]:
    """Of each of ``count`` columns, its number by name."""
    if not isinstance(given, dict) or any(
        not isinstance(row, list) or len(row) != count for row in given.values()
    ):
        raise BadInput(f"{file}: {what} must hold {count} numbers for each of {', '.join(names)}")
    columns = ({name: row[place] for name, row in given.items()} for place in range(count))
    return [_numbers(file, what, column, names, most) for column in columns]


def _numbers(
    file: Path, what: str, given: object, names: tuple[str, ...] | None, most: float | None = None
) -> dict[str, float]:
    """Above 0; with ``most`` of either sign, up to that."""
    if not isinstance(given, dict) or (names is not None and set(given) != set(names)):
        raise BadInput(f"{file}: {what} must name {', '.join(names or ('numbers',))}, nothing else")
    for name, value in given.items():
        is_number = not isinstance(value, bool) and isinstance(value, int | float) and math.isfinite(value)
        if not is_number or not (value > 0 if most is None else abs(value) <= most):
            wanted = "a number above 0" if most is None else f"a number from {-most:g} to {most:g}"
            raise BadInput(f"{file}: {name} of {what} is {value!r}; {wanted} is expected")
    return {str(name): float(value) for name, value in given.items()}
