"""One camera's picture of the hand, and the same window drawn from a state: what refinements compare.

The window around the glove is a grid of 32 x 32 cells. Of each cell it holds the share of every colour: of
the picture from its pixels, of a drawn hand from 3 x 3 points. Corners are drawn through the lens as it is,
so a picture need not be straightened.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.crop import Window
from glovecal_models.colour_glove.hand_state import HandState
from glovecal_models.colour_glove.pattern import Pattern
from glovecal_models.colour_glove.rasterise import z_buffer
from glovecal_models.colour_glove.skin import HandSkin, posed

CELLS, DRAWN_POINTS, SEEN_POINTS = 32, 3, 6
"""Cells along a side; points a cell along a side, of a drawn and of a seen window."""
CUFF_MM = 20.0
"""From the wrist towards the fingers: a forearm or a sleeve may hide the glove that far. Where this part is
drawn and no glove is seen, nothing is concluded."""
PARTS = "WTIMRP"
"""Of a hand: the palm, thumb to pinky."""
MARGIN = 1.15
"""Of the crop's window: a finger that the crop lost is still seen."""


@dataclass(frozen=True, eq=False)
class PrintedHand:
    """A hand in its glove: skin and pattern of the same triangles."""

    skin: HandSkin
    pattern: Pattern

    def __post_init__(self) -> None:
        behind = self.skin.vertices_mm[self.skin.triangles].mean(axis=1)[:, 0] < CUFF_MM
        object.__setattr__(self, "is_cuff", np.append(behind, False))
        object.__setattr__(self, "patch_of", np.append(self.pattern.patch, 0).astype(np.uint8))
        object.__setattr__(self, "colour_of", np.append(0, self.pattern.colour_of_patch).astype(np.uint8))
        mostly = self.skin.joints[self.skin.triangles[:, 0], 0]
        letters = [joint.name[0] for joint in self.skin.skeleton.joints]
        parts = np.array([PARTS.index(letter) for letter in letters])[mostly]
        object.__setattr__(self, "part_of", np.append(parts, 0).astype(np.uint8))

    patch_of: np.ndarray = None  # type: ignore[assignment]
    colour_of: np.ndarray = None  # type: ignore[assignment]
    """(T + 1,) and (P + 1,) uint8: of the background 0."""
    is_cuff: np.ndarray = None  # type: ignore[assignment]
    """(T + 1,) bool."""
    part_of: np.ndarray = None  # type: ignore[assignment]
    """(T + 1,) uint8: whose bone moves a triangle most, by ``PARTS``."""


@dataclass(frozen=True, eq=False)
class WindowView:
    """What one camera saw."""

    camera: Camera
    low_px: np.ndarray
    """(2,): the window's upper left corner, in pixels of the picture."""
    cell_px: float
    labels: np.ndarray
    """(192, 192) uint8: the colour seen at each point."""

    @classmethod
    def of(cls, labels: np.ndarray, window: Window, camera: Camera) -> WindowView:
        half = MARGIN * window.half
        low = np.array([window.u - half, window.v - half])
        points = sampled(labels, low[0], low[1], 2 * half / (CELLS * SEEN_POINTS), CELLS * SEEN_POINTS)
        return cls(camera, low, 2 * half / CELLS, points)

    def projected(self, vertices_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pixels (V, 2) of the picture and depth (V,) of points in the first camera's frame."""
        camera = self.camera
        return project(
            vertices_mm, np.array(camera.rotation), np.array(camera.translation_mm),
            np.array(camera.focal_px), np.array(camera.centre_px), np.array(camera.distortion),
        )  # fmt: skip

    def drawn(self, hand: PrintedHand, state: HandState) -> np.ndarray:
        """(96, 96) uint8: the patch at each point, 0 beside the hand."""
        return hand.patch_of[self.shown(hand, posed(hand.skin, state))]

    def seen_beside(self, hand: PrintedHand, shown: np.ndarray) -> np.ndarray:
        """(192, 192) uint8: ``labels``, with the cuff that ``shown`` draws where nothing is seen."""
        finer = SEEN_POINTS // DRAWN_POINTS
        cuff = np.where(hand.is_cuff[shown], hand.colour_of[hand.patch_of[shown]], np.uint8(0))
        return np.where(self.labels == 0, cuff.repeat(finer, axis=0).repeat(finer, axis=1), self.labels)

    def shown(self, hand: PrintedHand, vertices_mm: np.ndarray) -> np.ndarray:
        """(96, 96) int32: the triangle at each point, -1 beside the hand."""
        return self.shown_at(hand, *self.projected(vertices_mm))

    def shown_at(self, hand: PrintedHand, pixels: np.ndarray, depth: np.ndarray) -> np.ndarray:
        """As ``shown``, of vertices that are projected already."""
        points = (pixels - self.low_px) * (DRAWN_POINTS / self.cell_px) - 0.5
        side = CELLS * DRAWN_POINTS
        return z_buffer(points, depth, hand.skin.triangles, side, side, True)[0]

    def disagreeing(self, hand: PrintedHand, shown: np.ndarray) -> tuple[int, int]:
        """Points whose colours seen and drawn (``shown``) differ, and points of glove in either."""
        return differing(self.labels, shown, hand.patch_of, hand.colour_of, hand.is_cuff)

    def disagreeing_parts(self, hand: PrintedHand, shown: np.ndarray) -> np.ndarray:
        """(6, 2): of each of ``PARTS`` the drawn points whose colour seen is another, and all drawn."""
        return differing_parts(
            self.labels, shown, hand.patch_of, hand.colour_of, hand.is_cuff, hand.part_of, len(PARTS)
        )


@numba.njit(cache=True)
def sampled(labels, low_u, low_v, step, count):  # type: ignore[no-untyped-def]
    """Kernel: the nearest pixel's label at count x count points; outside the picture 0."""
    height, width = labels.shape
    found = np.zeros((count, count), dtype=np.uint8)
    for row in range(count):
        v = int(np.round(low_v + (row + 0.5) * step))
        if 0 <= v < height:
            for column in range(count):
                u = int(np.round(low_u + (column + 0.5) * step))
                if 0 <= u < width:
                    found[row, column] = labels[v, u]
    return found


@numba.njit(cache=True)
def differing(labels, shown, patch_of, colour_of, is_cuff):  # type: ignore[no-untyped-def]
    """Kernel: at the points of the coarser grid; a cuff that is not seen is taken for seen."""
    finer = labels.shape[0] // shown.shape[0]
    different = either = 0
    for v in range(shown.shape[0]):
        for u in range(shown.shape[1]):
            here = shown[v, u]
            drawn = colour_of[patch_of[here]]
            seen = labels[v * finer + finer // 2, u * finer + finer // 2]
            if seen == 0 and is_cuff[here]:
                seen = drawn
            if drawn or seen:
                either += 1
                if drawn != seen:
                    different += 1
    return different, either


@numba.njit(cache=True)
def differing_parts(labels, shown, patch_of, colour_of, is_cuff, part_of, parts):  # type: ignore[no-untyped-def]
    """Kernel: as ``differing``, of what is drawn, part by part."""
    finer, counts = labels.shape[0] // shown.shape[0], np.zeros((parts, 2))
    for v in range(shown.shape[0]):
        for u in range(shown.shape[1]):
            here = shown[v, u]
            if here < 0:
                continue
            drawn = colour_of[patch_of[here]]
            seen = labels[v * finer + finer // 2, u * finer + finer // 2]
            counts[part_of[here], 1] += 1.0
            if drawn != seen and not (seen == 0 and is_cuff[here]):
                counts[part_of[here], 0] += 1.0
    return counts


@numba.njit(cache=True)
def project(vertices, rotation, translation, focal, centre, distortion):  # type: ignore[no-untyped-def]
    """Kernel: ``Camera.project``, and the depth; points behind the camera get NaN."""
    pixels, depths = np.empty((len(vertices), 2)), np.empty(len(vertices))
    k1, k2, p1, p2, k3 = distortion
    for index in range(len(vertices)):
        a, b, c = vertices[index]
        x = rotation[0, 0] * a + rotation[0, 1] * b + rotation[0, 2] * c + translation[0]
        y = rotation[1, 0] * a + rotation[1, 1] * b + rotation[1, 2] * c + translation[1]
        z = rotation[2, 0] * a + rotation[2, 1] * b + rotation[2, 2] * c + translation[2]
        depths[index] = z
        if z <= 0.0:
            pixels[index] = np.nan
            continue
        x, y = x / z, y / z
        square = x * x + y * y
        radial = 1.0 + square * (k1 + square * (k2 + square * k3))
        u = x * radial + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x)
        v = y * radial + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y
        pixels[index, 0] = u * focal[0] + centre[0]
        pixels[index, 1] = v * focal[1] + centre[1]
    return pixels, depths


@numba.njit(cache=True)
def colour_shares(points, colour_of, channels, points_a_cell, blurs):  # type: ignore[no-untyped-def]
    """Kernel: (cells, cells, channels) float32: the share of each colour in each cell, blurred ``blurs``
    times by (1 2 1) / 4 both ways. Channel 0 is what is no glove; beyond the window is none."""
    cells = points.shape[0] // points_a_cell
    shares = np.zeros((cells, cells, channels), dtype=np.float32)
    weight = np.float32(1.0 / points_a_cell**2)
    for row in range(points.shape[0]):
        for column in range(points.shape[1]):
            shares[row // points_a_cell, column // points_a_cell, colour_of[points[row, column]]] += weight
    other = np.empty_like(shares)
    for _ in range(blurs):
        for row in range(cells):
            for column in range(cells):
                left, right = max(column - 1, 0), min(column + 1, cells - 1)
                for channel in range(channels):
                    other[row, column, channel] = (
                        np.float32(0.25) * (shares[row, left, channel] + shares[row, right, channel])
                        + np.float32(0.5) * shares[row, column, channel]
                    )
        for row in range(cells):
            above, below = max(row - 1, 0), min(row + 1, cells - 1)
            for column in range(cells):
                for channel in range(channels):
                    shares[row, column, channel] = (
                        np.float32(0.25) * (other[above, column, channel] + other[below, column, channel])
                        + np.float32(0.5) * other[row, column, channel]
                    )
    return shares
