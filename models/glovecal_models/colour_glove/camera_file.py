"""Cameras in a JSON file: one or several that see the same hand, the first at the origin.

``{"format": "glovecal cameras 1", "cameras": [{"width": 640, ...}]}``; keys of a camera are the fields of
``Camera``. What is read is checked: a key too many is as wrong as one too few.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.documents import read_json
from glovecal_models.errors import BadInput

FORMAT = "glovecal cameras 1"
MOST_CAMERAS, LARGEST_CAMERA_FILE = 16, 100_000
_NAMES = tuple(field.name for field in fields(Camera))
_LENGTHS = {"focal_px": 2, "centre_px": 2, "distortion": 5, "translation_mm": 3}


def camera_document(camera: Camera) -> dict[str, Any]:
    """A camera as JSON writes it."""
    return json.loads(json.dumps({name: getattr(camera, name) for name in _NAMES}))


def camera_from_document(document: Any) -> Camera:
    """The inverse of ``camera_document``. Raises BadInput for anything else."""
    if not isinstance(document, dict) or set(document) != set(_NAMES):
        given = sorted(document) if isinstance(document, dict) else type(document).__name__
        raise BadInput(f"a camera has the keys {', '.join(_NAMES)}; not {given}")
    for side in ("width", "height"):
        if type(document[side]) is not int:
            raise BadInput(f"{side} of a camera is {document[side]!r}; expected a whole number of pixels")
    values = {name: _numbers(document[name], name, length) for name, length in _LENGTHS.items()}
    rows = document["rotation"]
    if not isinstance(rows, list) or len(rows) != 3:
        raise BadInput(f"rotation of a camera is {rows!r}; expected three rows of three numbers")
    rotation = tuple(_numbers(row, "rotation", 3) for row in rows)
    return Camera(width=document["width"], height=document["height"], rotation=rotation, **values)


def write_cameras(file: Path, cameras: Sequence[Camera]) -> None:
    """Whole or not at all. Raises BadInput for no camera and for too many."""
    _require_count(len(cameras), str(file))
    document = {"format": FORMAT, "cameras": [camera_document(camera) for camera in cameras]}
    unfinished = file.with_name(f".{file.name}.part")
    unfinished.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    unfinished.replace(file)


def read_cameras(file: Path) -> tuple[Camera, ...]:
    """At least one. Raises BadInput that names the file, OSError."""
    size = file.stat().st_size
    if size > LARGEST_CAMERA_FILE:
        raise BadInput(f"{file}: {size} bytes; cameras take at most {LARGEST_CAMERA_FILE}")
    document = read_json(file.read_bytes(), str(file))
    if not isinstance(document, dict) or set(document) != {"format", "cameras"}:
        raise BadInput(f'{file}: expected "format" and "cameras", nothing else')
    if document["format"] != FORMAT or not isinstance(document["cameras"], list):
        raise BadInput(f"{file}: format is {document['format']!r}; expected {FORMAT!r} and a list of cameras")
    _require_count(len(document["cameras"]), str(file))
    found = []
    for number, entry in enumerate(document["cameras"], 1):
        try:
            found.append(camera_from_document(entry))
        except BadInput as error:
            raise BadInput(f"{file}, camera {number}: {error}") from error
    return tuple(found)


def _require_count(count: int, file: str) -> None:
    if not 1 <= count <= MOST_CAMERAS:
        raise BadInput(f"{file}: {count} cameras; 1 to {MOST_CAMERAS} are possible")


def _numbers(values: Any, name: str, length: int) -> Any:
    right = isinstance(values, list) and len(values) == length
    if not right or not all(type(value) in (int, float) and abs(value) < 1e9 for value in values):
        raise BadInput(f"{name} of a camera is {values!r}; expected {length} numbers")
    return tuple(float(value) for value in values)
