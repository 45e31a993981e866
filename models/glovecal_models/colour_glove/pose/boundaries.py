"""Where two labels meet in a drawn window: a boundary moves as the nearer of its two surfaces does."""

from __future__ import annotations

import numba
import numpy as np


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
