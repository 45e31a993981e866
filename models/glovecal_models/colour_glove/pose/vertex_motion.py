"""How points of the skin move, and their pixels, as each of the 26 degrees of freedom does: derivatives."""

from __future__ import annotations

import numba
import numpy as np

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.hand_state import DEGREES_OF_FREEDOM, HandState
from glovecal_models.colour_glove.skin import HandSkin, joint_frames


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
        np.array(camera.rotation), np.array(camera.translation_mm), np.array(camera.focal_px),
        np.array(camera.distortion), found,
    )  # fmt: skip
    return found


@numba.njit(cache=True)
def _pixel_motion(body, chain, state, vertices, where, turn, shift, focal, distortion, found):  # type: ignore[no-untyped-def]
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
