"""A pinhole camera with Brown's lens distortion, as OpenCV calibrates it: mm to pixels, and back to rays.

Pixels: u right, v down, (0, 0) is the centre of the first pixel. ``distortion`` is k1, k2, p1, p2, k3 (D. C.
Brown 1971, "Close-range camera calibration", Photogrammetric Engineering 37(8), 855-866).

Cameras in a JSON file: one or several that see the same hand, the first at the origin.

``{"format": "glovecal cameras 1", "cameras": [{"width": 640, ...}]}``; keys of a camera are the fields of
``Camera``. What is read is checked: a key too many is as wrong as one too few.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from glovecal_models.documents import read_json
from glovecal_models.errors import BadInput

_NO_TURN = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
MOST_PIXELS = 1 << 26
"""Of one picture."""
_UNDISTORT_STEPS = 30


@dataclass(frozen=True)
class Camera:
    """Raises BadInput for sizes and numbers that no camera has."""

    width: int = 640
    height: int = 480
    focal_px: tuple[float, float] = (533.0, 533.0)
    """Of a 4 mm lens before a 1/3 inch sensor (section 5.1)."""
    centre_px: tuple[float, float] = (319.5, 239.5)
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
    rotation: tuple[tuple[float, ...], ...] = field(default=_NO_TURN)
    """From the frame that points are given in to the camera's own; the first of several cameras has none."""
    translation_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if min(self.width, self.height) < 1 or self.width * self.height > MOST_PIXELS:
            raise BadInput(
                f"a picture of {self.width} x {self.height}; 1 to {MOST_PIXELS} pixels are possible"
            )
        if not min(self.focal_px) > 0:
            raise BadInput(f"focal length is {self.focal_px} pixels; it must be above 0")
        numbers = [*self.focal_px, *self.centre_px, *self.distortion, *self.translation_mm]
        matrix = np.array(self.rotation, dtype=float)
        if not np.isfinite(numbers).all() or matrix.shape != (3, 3) or not np.isfinite(matrix).all():
            raise BadInput(f"a camera needs finite numbers and a 3 x 3 rotation: {self}")
        if np.abs(matrix @ matrix.T - np.eye(3)).max() > 1e-6 or np.linalg.det(matrix) < 0:
            raise BadInput(f"rotation of a camera is no rotation matrix: {self.rotation}")

    def from_outside(self, points_mm: np.ndarray) -> np.ndarray:
        """Points (N, 3) in the camera's own frame."""
        return points_mm @ np.array(self.rotation).T + np.array(self.translation_mm)

    def project(self, points_mm: np.ndarray) -> np.ndarray:
        """Pixels (N, 2) of points (N, 3); NaN where a point is not before the camera."""
        x, y, z = self.from_outside(np.asarray(points_mm, dtype=float)).T
        ahead = np.where(z > 0, z, np.nan)
        return self._pixels(np.column_stack([x / ahead, y / ahead]))

    def undistort(self, points_px: np.ndarray) -> np.ndarray:
        """Directions (x / z, y / z) in the camera's own frame, (N, 2), that pixels (N, 2) show.

        Newton's method. Pixels far outside the picture may have none: NaN.
        """
        wanted = (np.asarray(points_px, dtype=float) - self.centre_px) / self.focal_px
        found = wanted.copy()
        if not any(self.distortion):
            return found
        step = 1e-6
        sides = step * np.eye(2)
        for _ in range(_UNDISTORT_STEPS):
            left = self._distorted(found) - wanted
            if np.nanmax(np.abs(left), initial=0.0) < 1e-13:
                break
            along_x, along_y = (
                (self._distorted(found + side) - self._distorted(found - side)) / (2 * step) for side in sides
            )
            determinant = along_x[:, 0] * along_y[:, 1] - along_x[:, 1] * along_y[:, 0]
            determinant = np.where(np.abs(determinant) < 1e-9, np.nan, determinant)
            found[:, 0] -= (along_y[:, 1] * left[:, 0] - along_y[:, 0] * left[:, 1]) / determinant
            found[:, 1] -= (along_x[:, 0] * left[:, 1] - along_x[:, 1] * left[:, 0]) / determinant
        wrong = np.abs(self._distorted(found) - wanted).max(axis=1) > 1e-9
        found[wrong] = np.nan
        return found

    def scaled(self, factor: int) -> Camera:
        """The same view in a picture ``factor`` times finer: its pixels share out the old ones'."""
        return self.resized(self.width * factor, self.height * factor)

    def resized(self, width: int, height: int) -> Camera:
        """The same view in a picture of another size, of which each pixel covers the same part."""
        shares = width / self.width, height / self.height
        fx, fy = (focal * share for focal, share in zip(self.focal_px, shares, strict=True))
        cu, cv = ((centre + 0.5) * share - 0.5 for centre, share in zip(self.centre_px, shares, strict=True))
        return replace(self, width=width, height=height, focal_px=(fx, fy), centre_px=(cu, cv))

    def _pixels(self, directions: np.ndarray) -> np.ndarray:
        return self._distorted(directions) * self.focal_px + self.centre_px

    def _distorted(self, directions: np.ndarray) -> np.ndarray:
        x, y = directions.T
        k1, k2, p1, p2, k3 = self.distortion
        square = x * x + y * y
        radial = 1.0 + square * (k1 + square * (k2 + square * k3))
        u = x * radial + 2 * p1 * x * y + p2 * (square + 2 * x * x)
        v = y * radial + p1 * (square + 2 * y * y) + 2 * p2 * x * y
        return np.column_stack([u, v])


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
