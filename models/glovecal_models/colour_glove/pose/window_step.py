"""How points of the skin move, and their pixels, as each of the 26 degrees of freedom does: derivatives.

Where two labels meet in a drawn window: a boundary moves as the nearer of its two surfaces does.

A Gaussian belief about a hand's state, and the step that weighs it against what pictures say.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numba
import numpy as np

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.hand_state import DEGREES_OF_FREEDOM, RANGE_DEG, HandState
from glovecal_models.colour_glove.skin import HandSkin, joint_frames

MOST_TURN_DEG, MOST_SHIFT_MM = 28.0, 80.0
"""Of one step: beyond, the linear model of a picture says nothing."""


def pixel_motion(
    skin: HandSkin, state: HandState, vertices: np.ndarray, places_mm: np.ndarray, camera: Camera
) -> np.ndarray:
    """(K, 2, 26): pixels by degrees and mm, in the order of ``HandState.moved``, of K vertices of the skin
    which lie at ``places_mm`` (K, 3) in the frame of the first camera."""
    parents, _, _, rotation_weights = skin.chain
    turned, places = joint_frames(*skin.chain, state.angles_deg)
    found = np.empty((len(vertices), 2, DEGREES_OF_FREEDOM))
    _pixel_motion(
        (skin.vertices_mm, skin.joints, skin.weights, *skin.unbound),
        (parents, rotation_weights, skin.skeleton.axes, turned, places),
        (state.rotation, state.position_mm),
        vertices, places_mm,
        (np.array(camera.rotation), np.array(camera.translation_mm), np.array(camera.focal_px),
         np.array(camera.distortion)),
        found,
    )  # fmt: skip
    return found


@numba.njit(cache=True)
def _pixel_motion(body, chain, state, vertices, where, camera, found):  # type: ignore[no-untyped-def]
    at_rest, joints, weights, back, offsets = body
    parents, rotation_weights, axes, turned, places = chain
    rotation, position = state
    count, rotations = len(parents), rotation_weights.shape[1]
    degree = np.pi / 180.0
    world, origins, carried = np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 3, 4))
    columns, shares = np.full((count, rotations), -1), np.zeros((count, rotations))
    for joint in range(count):
        palm = rotation @ turned[joint]
        world[joint] = palm @ axes[joint]
        origins[joint] = rotation @ places[joint] + position
        carried[joint, :, :3] = palm @ back[joint]
        carried[joint, :, 3] = palm @ offsets[joint] + origins[joint]
        moved_by = 0
        for column in range(rotations):
            if rotation_weights[joint, column] != 0.0:
                columns[joint, moved_by], shares[joint, moved_by] = column, rotation_weights[joint, column]
                moved_by += 1
    turn, shift, focal, distortion = camera
    k1, k2, p1, p2, k3 = distortion
    motion = np.empty((3, rotations + 6))
    for index in range(len(vertices)):
        vertex = vertices[index]
        motion[:] = 0.0
        rest_x, rest_y, rest_z = at_rest[vertex, 0], at_rest[vertex, 1], at_rest[vertex, 2]
        for place in range(joints.shape[1]):
            weight = weights[vertex, place]
            if weight == 0.0:
                break
            joint = joints[vertex, place]
            # Where this joint alone would carry the vertex.
            m = carried[joint]
            own_x = m[0, 0] * rest_x + m[0, 1] * rest_y + m[0, 2] * rest_z + m[0, 3]
            own_y = m[1, 0] * rest_x + m[1, 1] * rest_y + m[1, 2] * rest_z + m[1, 3]
            own_z = m[2, 0] * rest_x + m[2, 1] * rest_y + m[2, 2] * rest_z + m[2, 3]
            while joint >= 0:
                ax, ay, az = world[joint, 0], world[joint, 1], world[joint, 2]
                x, y, z = own_x - origins[joint, 0], own_y - origins[joint, 1], own_z - origins[joint, 2]
                for entry in range(rotations):
                    column = columns[joint, entry]
                    if column < 0:
                        break
                    share = shares[joint, entry] * weight * degree
                    motion[0, column] += share * (ay * z - az * y)
                    motion[1, column] += share * (az * x - ax * z)
                    motion[2, column] += share * (ax * y - ay * x)
                joint = parents[joint]
        x, y, z = where[index, 0] - position[0], where[index, 1] - position[1], where[index, 2] - position[2]
        motion[1, rotations], motion[2, rotations] = -z * degree, y * degree
        motion[0, rotations + 1], motion[2, rotations + 1] = z * degree, -x * degree
        motion[0, rotations + 2], motion[1, rotations + 2] = -y * degree, x * degree
        for axis in range(3):
            motion[axis, rotations + 3 + axis] = 1.0
        at_x, at_y, at_z = where[index, 0], where[index, 1], where[index, 2]
        a = turn[0, 0] * at_x + turn[0, 1] * at_y + turn[0, 2] * at_z + shift[0]
        b = turn[1, 0] * at_x + turn[1, 1] * at_y + turn[1, 2] * at_z + shift[1]
        c = turn[2, 0] * at_x + turn[2, 1] * at_y + turn[2, 2] * at_z + shift[2]
        x, y = a / c, b / c
        square = x * x + y * y
        radial = 1.0 + square * (k1 + square * (k2 + square * k3))
        slope = 2.0 * (k1 + square * (2.0 * k2 + square * 3.0 * k3))
        ux = radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x
        cross = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y
        vy = radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x
        for column in range(rotations + 6):
            da = (
                turn[0, 0] * motion[0, column]
                + turn[0, 1] * motion[1, column]
                + turn[0, 2] * motion[2, column]
            )
            db = (
                turn[1, 0] * motion[0, column]
                + turn[1, 1] * motion[1, column]
                + turn[1, 2] * motion[2, column]
            )
            dc = (
                turn[2, 0] * motion[0, column]
                + turn[2, 1] * motion[1, column]
                + turn[2, 2] * motion[2, column]
            )
            dx, dy = (da - x * dc) / c, (db - y * dc) / c
            found[index, 0, column] = focal[0] * (ux * dx + cross * dy)
            found[index, 1, column] = focal[1] * (cross * dx + vy * dy)


@numba.njit(cache=True)
def boundaries(shown, colour, triangles, depth, points_a_cell):  # type: ignore[no-untyped-def]
    """Kernel: every pair of neighbouring points of different colour, (B,) each: the vertex (of the K listed)
    that it moves with, its cell, the colours before and after it, whether it moves across (u) or down."""
    side = shown.shape[0]
    most = 2 * side * side
    row_of = np.full(len(depth), -1, dtype=np.int64)
    listed = np.empty(min(most, len(depth)), dtype=np.int64)
    which, cells = np.empty(most, dtype=np.int64), np.empty(most, dtype=np.int64)
    before, after = np.empty(most, dtype=np.uint8), np.empty(most, dtype=np.uint8)
    across = np.empty(most, dtype=np.bool_)
    count, vertices, wide = 0, 0, side // points_a_cell
    for v in range(side):
        for u in range(side):
            for is_across in (True, False):
                other_u, other_v = (u + 1, v) if is_across else (u, v + 1)
                if other_u >= side or other_v >= side or colour[v, u] == colour[other_v, other_u]:
                    continue
                here, there = shown[v, u], shown[other_v, other_u]
                nearer = max(here, there)
                if here >= 0 and there >= 0:
                    nearer = here
                    if depth[triangles[there, 0]] < depth[triangles[here, 0]]:
                        nearer = there
                vertex = triangles[nearer, 0]
                if row_of[vertex] < 0:
                    row_of[vertex], listed[vertices] = vertices, vertex
                    vertices += 1
                which[count] = row_of[vertex]
                cells[count] = (v // points_a_cell) * wide + u // points_a_cell
                before[count], after[count] = colour[v, u], colour[other_v, other_u]
                across[count] = is_across
                count += 1
    return (
        listed[:vertices].copy(), which[:count], cells[:count], before[:count], after[:count], across[:count],
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Belief:
    """A state and the covariance (26, 26) of steps away from it; degrees, degrees, mm."""

    state: HandState
    covariance: np.ndarray

    @cached_property
    def information(self) -> np.ndarray:
        """The inverse of the covariance."""
        return np.linalg.inv(self.covariance)


def damped_step(
    state: HandState, beliefs: tuple[Belief, ...], hessian: np.ndarray, gradient: np.ndarray, damping: float
) -> HandState:
    """The Gauss-Newton step of equation 2 (Wang & Popovic 2009, section 5.3), and of 5.4 with two beliefs.

    ``hessian`` (26, 26) and ``gradient`` (26,) are J' R^-1 J and J' R^-1 (c - f) of the pictures. Steps
    are cut to what a linear model bears, the answer to what a hand reaches.
    """
    total, pull = hessian.copy(), gradient.copy()
    for belief in beliefs:
        total += belief.information
        pull += belief.information @ belief.state.step_from(state)
    total[np.diag_indices_from(total)] *= 1.0 + damping
    step = np.linalg.solve(total, pull)
    # An angle that would leave its range stops there, and the others make the best of it.
    low, high = RANGE_DEG.T - state.angles_deg
    stuck = (step[:20] < low) & (pull[:20] < 0) | (step[:20] > high) & (pull[:20] > 0)
    if stuck.any():
        bound = np.flatnonzero(stuck)
        fixed = np.clip(step[bound], low[bound], high[bound])
        free = np.setdiff1d(np.arange(len(step)), bound)
        step[bound] = fixed
        step[free] = np.linalg.solve(
            total[np.ix_(free, free)], pull[free] - total[np.ix_(free, bound)] @ fixed
        )
    step[:23] = np.clip(step[:23], -MOST_TURN_DEG, MOST_TURN_DEG)
    step[23:] = np.clip(step[23:], -MOST_SHIFT_MM, MOST_SHIFT_MM)
    return state.moved(step).within_range()


def cost(state: HandState, beliefs: tuple[Belief, ...]) -> float:
    """Half the squared Mahalanobis distances to ``beliefs``."""
    return 0.5 * sum(
        float(apart @ belief.information @ apart)
        for belief in beliefs
        for apart in (belief.state.step_from(state),)
    )
