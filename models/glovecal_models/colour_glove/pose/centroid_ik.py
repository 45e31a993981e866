"""Inverse kinematics on the centroids of patches (Wang & Popovic 2009, section 5.3).

The state is drawn; of each visible patch the centroid is compared with that of the pixels seen in its colour,
and moves as the vertex does that lies nearest to it. Two patches have one colour: a seen pixel belongs to the
one whose drawn centroid is nearer. What is compared is centroid with drawn centroid, not with the vertex: a
patch that is partly hidden is so in both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np

from glovecal_models.colour_glove.hand_state import DEGREES_OF_FREEDOM, HandState
from glovecal_models.colour_glove.pose.gaussian_step import Belief, damped_step
from glovecal_models.colour_glove.pose.vertex_motion import pixel_motion
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
_LEAST_POINTS = 5.0
"""Of the drawn window: a smaller patch has no centroid."""


@dataclass(frozen=True, eq=False)
class Correspondences:
    """Of one view, K patches seen and drawn."""

    patches: np.ndarray
    vertices: np.ndarray
    """(K,): that move as the centroids do."""
    places_mm: np.ndarray
    """(K, 3): where these are."""
    apart_px: np.ndarray
    """(K, 2): seen minus drawn."""
    sd_px: np.ndarray
    """(K,)."""


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
        moving = pixel_motion(hand.skin, state, found.vertices, found.places_mm, view.camera)
        jacobian = (moving / found.sd_px[:, None, None]).reshape(-1, DEGREES_OF_FREEDOM)
        hessian += jacobian.T @ jacobian
        gradient += jacobian.T @ (found.apart_px / found.sd_px[:, None]).ravel()
    return hessian, gradient


def correspondences(
    hand: PrintedHand, view: WindowView, state: HandState, noise_cells: float
) -> Correspondences:
    """The patches both seen and drawn; R grows the less alike their areas are."""
    placed = posed(hand.skin, state)
    shown = view.shown(hand, placed)
    patch = hand.patch_of[shown]
    count = len(hand.colour_of) - 1
    drawn, nearest = drawn_patches(patch, shown, count)
    finer = SEEN_POINTS / DRAWN_POINTS
    centroids = (drawn[:, 1:] / np.maximum(drawn[:, :1], 1.0) + 0.5) * finer - 0.5
    visible = drawn[:, 0] >= _LEAST_POINTS
    seen = seen_patches(view.labels, centroids, visible, hand.colour_of, _GATE * CELLS * SEEN_POINTS)
    both = visible & (seen[:, 0] >= _LEAST_POINTS * finer**2)
    patches = np.flatnonzero(both)
    apart = (seen[both, 1:] / seen[both, :1] - centroids[both]) * (view.cell_px / SEEN_POINTS)
    ratio = seen[both, 0] / (drawn[both, 0] * finer**2)
    radius = np.sqrt(drawn[both, 0] / np.pi) / DRAWN_POINTS
    vertices = hand.skin.triangles[nearest[both], 0]
    # A patch of which one image shows less has its centroid elsewhere, by up to about its radius.
    sd_cells = np.hypot(noise_cells, BY_AREA * np.abs(np.log(ratio)) * radius)
    return Correspondences(patches, vertices, placed[vertices], apart, sd_cells * view.cell_px)


@numba.njit(cache=True)
def drawn_patches(patch, shown, count):  # type: ignore[no-untyped-def]
    """Kernel: points, sum of u, sum of v of each patch (P, 3); the triangle shown nearest to its centroid."""
    sums = np.zeros((count, 3))
    side = patch.shape[0]
    for v in range(side):
        for u in range(side):
            if patch[v, u]:
                sums[patch[v, u] - 1, 0] += 1.0
                sums[patch[v, u] - 1, 1] += u
                sums[patch[v, u] - 1, 2] += v
    nearest, least = np.zeros(count, dtype=np.int64), np.full(count, np.inf)
    for v in range(side):
        for u in range(side):
            if patch[v, u]:
                index = patch[v, u] - 1
                du, dv = u - sums[index, 1] / sums[index, 0], v - sums[index, 2] / sums[index, 0]
                if du * du + dv * dv < least[index]:
                    least[index] = du * du + dv * dv
                    nearest[index] = shown[v, u]
    return sums, nearest


@numba.njit(cache=True)
def seen_patches(labels, centroids, visible, colour_of, gate):  # type: ignore[no-untyped-def]
    """Kernel: points, sum of u, sum of v (P, 3) of the seen points nearest to each visible patch."""
    count = len(centroids)
    sums = np.zeros((count, 3))
    for v in range(labels.shape[0]):
        for u in range(labels.shape[1]):
            colour = labels[v, u]
            if colour == 0:
                continue
            best, least = -1, gate * gate
            for index in range(count):
                if visible[index] and colour_of[index + 1] == colour:
                    du, dv = u - centroids[index, 0], v - centroids[index, 1]
                    if du * du + dv * dv < least:
                        least, best = du * du + dv * dv, index
            if best >= 0:
                sums[best, 0] += 1.0
                sums[best, 1] += u
                sums[best, 2] += v
    return sums
