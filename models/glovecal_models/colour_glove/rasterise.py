"""Which triangle each pixel shows, and how far it is: a z-buffer over projected triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.errors import BadInput

NEAR_MM = 1.0
"""A triangle with a corner closer to the camera is not drawn."""


@dataclass(frozen=True, eq=False)
class Rendering:
    """What one camera sees of a mesh."""

    triangle: np.ndarray
    """(H, W) int32; -1: background."""
    depth_mm: np.ndarray
    """(H, W) float32, along the camera's z; infinite: background."""

    def painted(self, by_triangle: np.ndarray) -> np.ndarray:
        """(H, W) uint8 with each triangle's value from ``by_triangle`` (T,), 0 for background: with a
        pattern's colours a label image, with its patches a patch image."""
        return np.append(by_triangle, 0).astype(np.uint8)[self.triangle]


def rasterise(vertices_mm: np.ndarray, triangles: np.ndarray, camera: Camera) -> Rendering:
    """Draw triangles (T, 3) of vertices (V, 3), which are given in the frame that the camera stands in.

    A pixel shows the nearest triangle that covers its centre; of two equally near ones the first. Both sides
    of a triangle are drawn. Corners are distorted by the lens, edges between them stay straight. Raises
    BadInput for other shapes.
    """
    vertices = np.asarray(vertices_mm, dtype=float)
    triangles = np.asarray(triangles, dtype=np.int32)
    if vertices.ndim != 2 or vertices.shape[1] != 3 or triangles.ndim != 2 or triangles.shape[1] != 3:
        raise BadInput(
            f"a mesh has vertices (V, 3), triangles (T, 3); not {vertices.shape}, {triangles.shape}"
        )
    if triangles.size and (triangles.min() < 0 or triangles.max() >= len(vertices)):
        raise BadInput(f"triangles name vertices {triangles.min()} to {triangles.max()} of {len(vertices)}")
    pixels = camera.project(vertices)
    depth = camera.from_outside(vertices)[:, 2]
    triangle, found = z_buffer(pixels, depth, triangles, camera.height, camera.width)
    return Rendering(triangle, found)


@numba.njit(cache=True)
def z_buffer(pixels, depth, triangles, height, width, fronts_only=False):  # type: ignore[no-untyped-def]
    """Kernel: triangle (H, W) int32 and depth (H, W) float32 of corners ``pixels`` (V, 2), ``depth`` (V,).

    1 / depth is linear over the picture of a plane, so it is what the buffer holds. ``fronts_only`` leaves
    out triangles whose corners run clockwise in the picture: of the closed skin those that face away, half of
    them, in almost half the time.
    """
    shown = np.full((height, width), -1, dtype=np.int32)
    inverse = np.zeros((height, width))
    for index in range(len(triangles)):
        a, b, c = triangles[index]
        if not (depth[a] >= NEAR_MM and depth[b] >= NEAR_MM and depth[c] >= NEAR_MM):
            continue
        ax, ay, bx, by = pixels[a, 0], pixels[a, 1], pixels[b, 0], pixels[b, 1]
        cx, cy = pixels[c, 0], pixels[c, 1]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if not np.abs(area) > 1e-12 or (fronts_only and area > 0.0):
            continue
        left = np.ceil(max(min(ax, bx, cx), 0.0))
        right = np.floor(min(max(ax, bx, cx), width - 1.0))
        top = np.ceil(max(min(ay, by, cy), 0.0))
        bottom = np.floor(min(max(ay, by, cy), height - 1.0))
        if left > right or top > bottom:
            continue
        wa, wb, wc = 1.0 / depth[a], 1.0 / depth[b], 1.0 / depth[c]
        for v in range(int(top), int(bottom) + 1):
            for u in range(int(left), int(right) + 1):
                share_a = ((bx - u) * (cy - v) - (by - v) * (cx - u)) / area
                share_b = ((cx - u) * (ay - v) - (cy - v) * (ax - u)) / area
                share_c = ((ax - u) * (by - v) - (ay - v) * (bx - u)) / area
                if share_a < 0.0 or share_b < 0.0 or share_c < 0.0:
                    continue
                near = share_a * wa + share_b * wb + share_c * wc
                if near > inverse[v, u]:
                    inverse[v, u] = near
                    shown[v, u] = index
    found = np.empty((height, width), dtype=np.float32)
    for v in range(height):
        for u in range(width):
            found[v, u] = 1.0 / inverse[v, u] if inverse[v, u] > 0.0 else np.inf
    return shown, found
