"""Refinement on the labels of all pixels: the fourth stage, which the paper calls too slow for 2009.

Shares of colours in the cells of the window, seen against drawn, by Levenberg-Marquardt. A share changes only
where a boundary between two labels moves, and a boundary moves as the nearer of its two surfaces does: the
derivatives are a sum over the boundaries of one drawing, and no drawing is needed for each degree of freedom.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np

from glovecal_models.colour_glove.hand_state import DEGREES_OF_FREEDOM, HandState
from glovecal_models.colour_glove.pose.window_step import Belief, boundaries, cost, damped_step, pixel_motion
from glovecal_models.colour_glove.pose.window_view import (
    CELLS,
    DRAWN_POINTS,
    SEEN_POINTS,
    PrintedHand,
    WindowView,
    colour_shares,
)
from glovecal_models.colour_glove.skin import posed

ITERATIONS = 12
SHARE_SD = 0.17
"""Standard deviation of a cell's share of a colour. Neighbouring cells err together; this stands for that."""
_BLURS = 1
_LEAST_GAIN = 1e-3
"""Of the cost: what gains less is done."""


@dataclass(frozen=True, eq=False)
class DenseFit:
    state: HandState
    cost: float


def refine_by_labels(
    hand: PrintedHand,
    views: Sequence[WindowView],
    start: HandState,
    beliefs: tuple[Belief, ...],
    iterations: int = ITERATIONS,
) -> DenseFit:
    """The state of least cost that at most ``iterations`` steps from ``start`` find."""
    channels = int(hand.colour_of.max()) + 1

    def measured(state: HandState) -> tuple[float, list[_Drawn]]:
        placed = posed(hand.skin, state)
        drawn = [_Drawn(hand, view, placed, channels, _BLURS) for view in views]
        apart = sum(float(np.square(each.apart).sum()) for each in drawn)
        return 0.5 * apart / SHARE_SD**2 + cost(state, beliefs), drawn

    state = start
    (best, here), damping = measured(state), 0.05
    for _ in range(iterations):
        hessian = np.zeros((DEGREES_OF_FREEDOM,) * 2)
        gradient = np.zeros(DEGREES_OF_FREEDOM)
        for drawn in here:
            jacobian = drawn.jacobian(state) / np.float32(SHARE_SD)
            hessian += jacobian.T @ jacobian
            gradient += jacobian.T @ (drawn.apart.ravel() / np.float32(SHARE_SD))
        before = best
        for _ in range(4):
            moved = damped_step(state, beliefs, hessian, gradient, damping)
            cost_moved, drawn_moved = measured(moved)
            if cost_moved < best:
                state, here, best, damping = moved, drawn_moved, cost_moved, damping * 0.4
                break
            damping = max(damping, 0.02) * 6.0
        if before - best < _LEAST_GAIN * max(best, 1.0):
            break
    return DenseFit(state, best)


def label_equations(hand: PrintedHand, views: Sequence[WindowView], state: HandState) -> np.ndarray:
    """(26, 26): J' J over the square of ``SHARE_SD`` at ``state``: the information of the pictures alone."""
    placed, channels = posed(hand.skin, state), int(hand.colour_of.max()) + 1
    found = np.zeros((DEGREES_OF_FREEDOM,) * 2)
    for view in views:
        jacobian = _Drawn(hand, view, placed, channels, _BLURS).jacobian(state) / np.float32(SHARE_SD)
        found += jacobian.T @ jacobian
    return found


def joint_equations(
    hand: PrintedHand, views: Sequence[WindowView], state: HandState, motion_mm: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """J' J and J' r over the square of ``SHARE_SD`` for the pose and P other parameters: (26 + P, 26 + P),
    (26 + P,). ``motion_mm`` (V, 3, P): how they move the vertices as they are posed."""
    placed, channels = posed(hand.skin, state), int(hand.colour_of.max()) + 1
    size = DEGREES_OF_FREEDOM + motion_mm.shape[2]
    hessian, gradient = np.zeros((size, size)), np.zeros(size)
    for view in views:
        drawn = _Drawn(hand, view, placed, channels, _BLURS)
        both = [drawn.jacobian(state), drawn.jacobian(state, motion_mm)]
        jacobian = np.concatenate(both, axis=1) / np.float32(SHARE_SD)
        moving = np.flatnonzero(jacobian.any(axis=1))  # few cells hold a boundary of a colour
        jacobian = jacobian[moving].astype(float)
        hessian += jacobian.T @ jacobian
        gradient += jacobian.T @ (drawn.apart.ravel()[moving] / SHARE_SD)
    return hessian, gradient


class _Drawn:
    """A state drawn into one view."""

    def __init__(
        self, hand: PrintedHand, view: WindowView, placed_mm: np.ndarray, channels: int, blurs: int
    ) -> None:
        self.hand, self.view, self.placed_mm, self.channels, self.blurs = (
            hand, view, placed_mm, channels, blurs,
        )  # fmt: skip
        self.shown = view.shown(hand, placed_mm)
        self.shares = colour_shares(hand.patch_of[self.shown], hand.colour_of, channels, DRAWN_POINTS, blurs)
        seen, plain = view.seen_beside(hand, self.shown), np.arange(channels, dtype=np.uint8)
        self.apart = colour_shares(seen, plain, channels, SEEN_POINTS, blurs) - self.shares
        """(cells, cells, channels) float32, as ``shares``: seen less drawn."""

    def jacobian(self, state: HandState, motion_mm: np.ndarray | None = None) -> np.ndarray:
        """(cells * cells * channels, 26) float32; with ``motion_mm`` (V, 3, P) one by other parameters, P."""
        depth = self.view.projected(self.placed_mm)[1]
        colour = self.hand.colour_of[self.hand.patch_of[self.shown]]
        vertices, which, cells, before, after, across = boundaries(
            self.shown, colour, self.hand.skin.triangles, depth, DRAWN_POINTS
        )
        places = self.placed_mm[vertices]
        if motion_mm is None:
            moving = pixel_motion(self.hand.skin, state, vertices, places, self.view.camera)
        else:
            moving = _projected_motion(self.view, places, motion_mm[vertices])
        moving *= 1.0 / (DRAWN_POINTS * self.view.cell_px)  # one point's row of a boundary, in cells
        return moved_shares(
            moving, which, cells, before, after, across, CELLS, self.channels, self.blurs
        ).reshape(-1, moving.shape[2])


def _projected_motion(view: WindowView, places_mm: np.ndarray, motion_mm: np.ndarray) -> np.ndarray:
    """(K, 2, P) pixels, from (K, 3) and (K, 3, P) mm."""
    by_place = np.stack(
        [
            (view.projected(places_mm + step)[0] - view.projected(places_mm - step)[0]) / 2
            for step in np.eye(3)
        ],
        axis=2,
    )
    return by_place @ motion_mm


@numba.njit(cache=True)
def moved_shares(moving, which, cells, before, after, across, wide, channels, blurs):  # type: ignore[no-untyped-def]
    """Kernel: (cells, cells, channels, 26) float32, blurred as the shares are."""
    degrees = moving.shape[2]
    found = np.zeros((wide * wide, channels, degrees), dtype=np.float32)
    for index in range(len(which)):
        axis = 0 if across[index] else 1
        for column in range(degrees):
            moved = np.float32(moving[which[index], axis, column])
            found[cells[index], before[index], column] += moved
            found[cells[index], after[index], column] -= moved
    field = found.reshape((wide, wide, channels * degrees))
    other = np.empty_like(field)
    half, quarter = np.float32(0.5), np.float32(0.25)
    for _ in range(blurs):
        for row in range(wide):
            for column in range(wide):
                left, right = max(column - 1, 0), min(column + 1, wide - 1)
                for value in range(channels * degrees):
                    other[row, column, value] = (
                        quarter * (field[row, left, value] + field[row, right, value])
                        + half * field[row, column, value]
                    )
        for row in range(wide):
            above, below = max(row - 1, 0), min(row + 1, wide - 1)
            for column in range(wide):
                for value in range(channels * degrees):
                    field[row, column, value] = (
                        quarter * (other[above, column, value] + other[below, column, value])
                        + half * other[row, column, value]
                    )
    return field
