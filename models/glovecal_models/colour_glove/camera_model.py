"""A pinhole camera with Brown's lens distortion, as OpenCV calibrates it: mm to pixels, and back to rays.

Pixels: u right, v down, (0, 0) is the centre of the first pixel. ``distortion`` is k1, k2, p1, p2, k3 (D. C.
Brown 1971, "Close-range camera calibration", Photogrammetric Engineering 37(8), 855-866).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

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

    def without_distortion(self) -> Camera:
        """The ideal camera at the same place."""
        return replace(self, distortion=(0.0,) * 5)

    def scaled(self, factor: int) -> Camera:
        """The same view in a picture ``factor`` times finer: its pixels share out the old ones'."""
        fx, fy = (focal * factor for focal in self.focal_px)
        cu, cv = ((centre + 0.5) * factor - 0.5 for centre in self.centre_px)
        return replace(
            self,
            width=self.width * factor,
            height=self.height * factor,
            focal_px=(fx, fy),
            centre_px=(cu, cv),
        )

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
