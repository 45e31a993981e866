"""Inverse kinematics on the centroids of patches (Wang & Popovic 2009, section 5.3), and on their areas.

The state is drawn; of each visible patch the centroid is compared with that of the pixels seen in its colour.
Two patches have one colour: a seen pixel belongs to the one whose drawn centroid is nearer. What is compared
is centroid with drawn centroid, not with a vertex: a patch that is partly hidden is so in both. The paper
moves a centroid as the vertex nearest to it; here it moves as the boundaries of what is visible of the patch
do, which also tells how its area changes (ours): a joint that turns a patch away hardly moves its centroid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np

from glovecal_models.colour_glove.hand_state import DEGREES_OF_FREEDOM, HandState
from glovecal_models.colour_glove.pose.window_step import Belief, boundaries, damped_step, pixel_motion
from glovecal_models.colour_glove.pose.window_view import (
    CELLS,
    DRAWN_POINTS,
    SEEN_POINTS,
    PrintedHand,
    WindowView,
)
from glovecal_models.colour_glove.skin import posed

FULL_NOISE_CELLS = (0.4, 0.25, 0.15, 0.15, 0.15)
"""R of each round: the first ones do not believe much in what is matched to what yet."""
_GATE = 0.15
"""Of the window's side: a seen pixel farther from a patch's centroid is none of it."""
BY_AREA = 0.55
"""Of a patch's radius for each unit of |log of the ratio of its areas|; chosen on rendered frames, as R."""
AREA_SD, AREA_EDGE_POINTS = 0.2, 0.5
"""Standard deviation of the logarithm of an area at R = 0.15 cells, and what a wrong edge adds to it, by the
patch's radius in points of the drawn window."""
_AREA_BELIEVED = 2.0
"""Standard deviations from which on a ratio of areas counts less and less: something else hides the patch."""
_LEAST_POINTS = 5.0
"""Of the drawn window: a smaller patch has no centroid."""


@dataclass(frozen=True, eq=False)
class Correspondences:
    """Of one view, K patches seen and drawn; residuals are seen minus drawn, each with its derivative."""

    patches: np.ndarray
    apart_px: np.ndarray
    """(K, 2): of the centroids."""
    sd_px: np.ndarray
    """(K,)."""
    motion_px: np.ndarray
    """(K, 2, 26): pixels by degrees and mm."""
    log_area: np.ndarray
    """(K,): logarithm of the area seen by that drawn."""
    sd_log_area: np.ndarray
    """(K,)."""
    growth: np.ndarray
    """(K, 26): of the drawn area's logarithm."""


def refine_by_centroids(
    hand: PrintedHand,
    views: Sequence[WindowView],
    start: HandState,
    beliefs: tuple[Belief, ...],
    noise_cells: Sequence[float] = FULL_NOISE_CELLS,
) -> HandState:
    """The state after one Gauss-Newton step for each of ``noise_cells``, each with the hand drawn anew."""
    state = start
    for noise in noise_cells:
        hessian, gradient = centroid_equations(hand, views, state, noise)
        state = damped_step(state, beliefs, hessian, gradient, 0.0)
    return state


def centroid_equations(
    hand: PrintedHand, views: Sequence[WindowView], state: HandState, noise_cells: float
) -> tuple[np.ndarray, np.ndarray]:
    """J' R^-1 J (26, 26) and J' R^-1 (c - f(q)) (26,)."""
    hessian, gradient = np.zeros((DEGREES_OF_FREEDOM,) * 2), np.zeros(DEGREES_OF_FREEDOM)
    for view in views:
        found = correspondences(hand, view, state, noise_cells)
        if not len(found.patches):
            continue
        places = (found.motion_px / found.sd_px[:, None, None]).reshape(-1, DEGREES_OF_FREEDOM)
        jacobian = np.concatenate([places, found.growth / found.sd_log_area[:, None]])
        apart = (found.apart_px / found.sd_px[:, None]).ravel()
        hessian += jacobian.T @ jacobian
        gradient += jacobian.T @ np.append(apart, found.log_area / found.sd_log_area)
    return hessian, gradient


def correspondences(
    hand: PrintedHand, view: WindowView, state: HandState, noise_cells: float
) -> Correspondences:
    """The patches both seen and drawn; R grows the less alike their areas are."""
    placed = posed(hand.skin, state)
    pixels, depth = view.projected(placed)
    shown = view.shown_at(hand, pixels, depth)
    drawn, patch = drawn_patches(shown, hand.patch_of, len(hand.colour_of) - 1)
    visible = drawn[:, 0] >= _LEAST_POINTS
    places = drawn[:, 1:] / np.maximum(drawn[:, :1], 1.0)
    finer = SEEN_POINTS / DRAWN_POINTS
    seen = seen_patches(
        view.labels, (places + 0.5) * finer - 0.5, visible, hand.colour_of, _GATE * CELLS * SEEN_POINTS,
        shown, patch, hand.is_cuff,
    )  # fmt: skip
    seen[:, 0] /= finer**2
    both = visible & (seen[:, 0] >= _LEAST_POINTS)
    patches, areas = np.flatnonzero(both), drawn[both, 0]
    seen_places = (seen[both, 1:] / (seen[both, :1] * finer**2) + 0.5) / finer - 0.5
    log_area, radius = np.log(seen[both, 0] / areas), np.sqrt(areas / np.pi)
    # A patch of which one image shows less has its centroid elsewhere, by up to about its radius.
    sd_cells = np.hypot(noise_cells, BY_AREA * np.abs(log_area) * radius / DRAWN_POINTS)
    sd_area = np.hypot(AREA_SD, AREA_EDGE_POINTS / radius) * (noise_cells / FULL_NOISE_CELLS[-1])
    sd_area = np.hypot(sd_area, log_area / _AREA_BELIEVED)
    moved = _moved_patches(hand, view, state, (placed, depth), shown, patch, places)[both]
    moved /= areas[:, None, None]
    px = view.cell_px / DRAWN_POINTS
    return Correspondences(
        patches, (seen_places - places[both]) * px, sd_cells * view.cell_px, moved[:, 1:] * px,
        log_area, sd_area, moved[:, 0],
    )  # fmt: skip


def _moved_patches(
    hand: PrintedHand, view: WindowView, state: HandState, body: tuple[np.ndarray, np.ndarray],
    shown: np.ndarray, patch: np.ndarray, centroids: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """(P, 3, 26): derivatives of each patch's points, and of the sums of u and v about its centroid.
    ``body``: places (V, 3) and depths (V,) of the vertices."""
    placed_mm, depth = body
    vertices, which, places, before, after, across = boundaries(shown, patch, hand.skin.triangles, depth, 1)
    moving = pixel_motion(hand.skin, state, vertices, placed_mm[vertices], view.camera)
    moving *= DRAWN_POINTS / view.cell_px
    return moved_sums(moving, which, places, before, after, across, centroids, shown.shape[0])


@numba.njit(cache=True)
def drawn_patches(shown, patch_of, count):  # type: ignore[no-untyped-def]
    """Kernel: points, sum of u, sum of v of each patch (P, 3), and the patch at each point."""
    sums, patch = np.zeros((count, 3)), np.empty(shown.shape, dtype=np.uint8)
    for v in range(shown.shape[0]):
        for u in range(shown.shape[1]):
            here = patch_of[shown[v, u]]
            patch[v, u] = here
            if here:
                sums[here - 1, 0] += 1.0
                sums[here - 1, 1] += u
                sums[here - 1, 2] += v
    return sums, patch


@numba.njit(cache=True)
def moved_sums(moving, which, places, before, after, across, centroids, side):  # type: ignore[no-untyped-def]
    """Kernel: what a patch gains on its boundaries, the patch beside it loses."""
    degrees = moving.shape[2]
    found = np.zeros((len(centroids), 3, degrees))
    for index in range(len(which)):
        axis = 0 if across[index] else 1
        u, v = places[index] % side + 0.5 * (1 - axis), places[index] // side + 0.5 * axis
        for sign, patch in ((1.0, before[index]), (-1.0, after[index])):
            if patch == 0:
                continue
            along, down = u - centroids[patch - 1, 0], v - centroids[patch - 1, 1]
            for column in range(degrees):
                gained = sign * moving[which[index], axis, column]
                found[patch - 1, 0, column] += gained
                found[patch - 1, 1, column] += along * gained
                found[patch - 1, 2, column] += down * gained
    return found


@numba.njit(cache=True)
def seen_patches(labels, centroids, visible, colour_of, gate, shown, patch, is_cuff):  # type: ignore[no-untyped-def]
    """Kernel: points, sum of u, sum of v (P, 3) of the seen points nearest to each visible patch. Where no
    glove is seen on the cuff, what is drawn there is taken for seen."""
    count, finer = len(centroids), labels.shape[0] // shown.shape[0]
    # Per colour: how many visible patches have it, and which.
    having, which = np.zeros(256, dtype=np.int64), np.empty((256, count), dtype=np.int64)
    for index in range(count):
        if visible[index]:
            colour = colour_of[index + 1]
            which[colour, having[colour]] = index
            having[colour] += 1
    sums = np.zeros((count, 3))
    nearest = gate * gate
    for v in range(labels.shape[0]):
        row = v // finer
        for column in range(shown.shape[1]):
            there = shown[row, column]
            unseen = colour_of[patch[row, column]] if there >= 0 and is_cuff[there] else 0
            for u in range(column * finer, (column + 1) * finer):
                colour = labels[v, u] if labels[v, u] else unseen
                if colour == 0:
                    continue
                best, least = -1, nearest
                for place in range(having[colour]):
                    index = which[colour, place]
                    du, dv = u - centroids[index, 0], v - centroids[index, 1]
                    if du * du + dv * dv < least:
                        least, best = du * du + dv * dv, index
                if best >= 0:
                    sums[best, 0] += 1.0
                    sums[best, 1] += u
                    sums[best, 2] += v
    return sums
