"""The glove's two pieces of cloth: the palm's side and the back's side of the skin, cut apart and laid flat.

The skin lies with spread fingers. It is cut where it faces neither up nor down (the seam) and at the wrist
(the opening); each side is then flattened with as little stretching as possible (L. Liu et al. 2008, "A
Local/Global Approach to Mesh Parameterization", Computer Graphics Forum 27(5), their ARAP energy). A
silhouette would not do: a finger's half girth is half as wide again as the finger.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from glovecal_models.colour_glove.pattern import Pattern
from glovecal_models.colour_glove.skin import HandSkin, configured
from glovecal_models.errors import BadInput

SIDES = ("palm", "back")
_SPREAD_DEG = {"TI_ABD": 55.0, "IM_ABD": 24.0, "MR_ABD": 24.0, "RP_ABD": 24.0}
"""So that pieces, wider than fingers, do not overlap."""
_WRIST = -0.07
"""Of the hand's length: where the glove ends, beyond the wrist's crease."""
_SMOOTHED_MM = 8.0
"""Over which the seam follows the skin."""
_ROUNDS = 40
_SEAM_WEIGHT = 20.0
"""Of the triangles along the outline, over that of others."""
_FLATTEST = 1e-3
"""Cotangent weights are at least so large: slivers along the seam have none."""


@dataclass(frozen=True, eq=False)
class FlatPiece:
    """One side of the glove, as it is to be seen from outside: x to the right, y down, fingers up."""

    side: str
    """palm or back."""
    points_mm: np.ndarray
    """(V, 2)."""
    triangles: np.ndarray
    """(T, 3)."""
    patch: np.ndarray
    """(T,) uint8, 1 to P."""
    surface_mm: np.ndarray
    """(V, 3) of the same points on the skin, in the palm's frame."""

    @cached_property
    def _outline(self) -> np.ndarray:
        return max(borders(self.triangles), key=len)

    @property
    def outline_mm(self) -> np.ndarray:
        """(N, 2): seam and opening, closed (the first point is not repeated)."""
        return self.points_mm[self._outline]

    @property
    def outline_on_skin_mm(self) -> np.ndarray:
        """(N, 3): the same points on the skin."""
        return self.surface_mm[self._outline]

    @property
    def patch_along_outline(self) -> np.ndarray:
        """(N,): the patch that lies at the outline between each point and the next."""
        of_edge = {
            (int(row[k]), int(row[(k + 1) % 3])): patch
            for row, patch in zip(self.triangles, self.patch, strict=True)
            for k in range(3)
        }
        loop = self._outline
        return np.array([of_edge[int(a), int(b)] for a, b in zip(loop, np.roll(loop, -1), strict=True)])

    def patch_outlines_mm(self, patch: int) -> list[np.ndarray]:
        """Its borders, each (N, 2), closed; none when it does not lie on this side."""
        return [self.points_mm[loop] for loop in borders(self.triangles[self.patch == patch])]

    @property
    def hem_mm(self) -> float:
        """How far the opening lies behind the wrist's crease."""
        return -float(self.surface_mm[:, 0].min())

    @property
    def crease_mm(self) -> np.ndarray:
        """(K, 2, 2): the wrist's crease, as pieces of a line; where the skin has x = 0."""
        height, pieces = self.surface_mm[:, 0], []
        for corners in self.triangles[np.ptp(np.sign(height[self.triangles]), axis=1) == 2]:
            ends = [
                self.points_mm[a]
                + (self.points_mm[b] - self.points_mm[a]) * height[a] / (height[a] - height[b])
                for a, b in zip(corners, np.roll(corners, -1), strict=True)
                if height[a] * height[b] < 0
            ]
            pieces.append(ends)
        return np.array(pieces).reshape(-1, 2, 2)

    @property
    def stretch(self) -> np.ndarray:
        """(E,) length of each edge on the sheet over its length on the skin."""
        pairs = np.concatenate(
            [self.triangles[:, [0, 1]], self.triangles[:, [1, 2]], self.triangles[:, [2, 0]]]
        )
        pairs = np.unique(np.sort(pairs, axis=1), axis=0)
        flat, solid = (
            np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
            for points in (self.points_mm, self.surface_mm)
        )
        return flat[solid > 0.2] / solid[solid > 0.2]


def flat_pieces(skin: HandSkin, pattern: Pattern) -> tuple[FlatPiece, FlatPiece]:
    """Palm's side and back's side. Raises BadInput for a pattern of another skin."""
    if len(pattern.patch) != len(skin.triangles):
        raise BadInput(f"a pattern for {len(pattern.patch)} triangles on a skin of {len(skin.triangles)}")
    vertices = _spread(skin)
    opening = vertices[:, 0] - _WRIST * skin.skeleton.dimensions.hand_length_mm
    up = _upward(vertices, skin.triangles)
    triangles, patch = skin.triangles.astype(np.int64), pattern.patch
    values = np.column_stack([opening, up])
    vertices, triangles, patch, values = _cut(vertices, triangles, patch, values, 0)
    vertices, triangles, patch, values = _cut(vertices, triangles, patch, values, 1)
    inside = values[triangles, 0].mean(axis=1) > 0
    is_back = _without_islands(triangles, values[triangles, 1].mean(axis=1) > 0, inside)
    found = []
    for side, chosen in (("palm", inside & ~is_back), ("back", inside & is_back)):
        used, corners = np.unique(triangles[chosen], return_inverse=True)
        surface, corners = vertices[used], corners.reshape(-1, 3)
        # Seen from outside, fingers up: the palm has the thumb of a right hand on its right.
        start = np.column_stack([surface[:, 1] * (1.0 if side == "palm" else -1.0), -surface[:, 0]])
        flat = _flattened(surface, corners, start)
        found.append(FlatPiece(side, flat, corners, patch[chosen], surface))
    return found[0], found[1]


def borders(triangles: np.ndarray) -> list[np.ndarray]:
    """Closed runs of vertices along edges that only one triangle has, in the triangles' sense of rotation."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    known = {(int(a), int(b)) for a, b in edges}
    leads: dict[int, list[int]] = {}
    for a, b in sorted(known):
        if (b, a) not in known:
            leads.setdefault(a, []).append(b)
    found = []
    while leads:
        start = next(iter(leads))
        loop, at = [start], leads[start].pop()
        while at != start:
            loop.append(at)
            at = leads[at].pop()
        leads = {vertex: ways for vertex, ways in leads.items() if ways}
        found.append(np.array(loop))
    return found


def _spread(skin: HandSkin) -> np.ndarray:
    """(V, 3) with fingers apart, of a right or left hand."""
    from glovecal_models.colour_glove.hand_state import FINGER_ROTATIONS

    angles = skin.rest_deg.copy()
    for name, angle in _SPREAD_DEG.items():
        angles[FINGER_ROTATIONS.index(name)] = angle
    return configured(skin, angles[None])[0]


def _upward(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(V,) how far the skin faces up (the nails' side), smoothed over the surface, so that the seam runs
    quietly: one implicit step of heat flow."""
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    normals = np.cross(b - a, c - a)
    of_vertex = np.zeros((len(vertices), 2))
    shares = np.column_stack([normals[:, 2], np.linalg.norm(normals, axis=1)])
    for corner in range(3):
        np.add.at(of_vertex, triangles[:, corner], shares / 6.0)
    facing, area = of_vertex.T
    _, laplacian = _cotangents(_own_planes(vertices, triangles), triangles, len(vertices))
    return splu((sparse.diags(area) + _SMOOTHED_MM**2 * laplacian).tocsc()).solve(facing)


def _cotangents(
    local: np.ndarray, triangles: np.ndarray, count: int, of_triangle: np.ndarray | float = 1.0
) -> tuple[np.ndarray, sparse.csc_matrix]:
    """Weights (T, 3) of the edges from corner k to corner k + 1, and the surface's Laplacian (V, V)."""
    opposite = np.roll(local, 1, axis=1)
    u, v = local - opposite, np.roll(local, -1, axis=1) - opposite
    cross = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    weights = np.maximum((u * v).sum(axis=2) / np.maximum(np.abs(cross), 1e-9), _FLATTEST) / 2
    weights = weights * np.reshape(of_triangle, (-1, 1))
    pairs = (triangles.ravel(), np.roll(triangles, -1, axis=1).ravel())
    joined = sparse.csc_matrix((weights.ravel(), pairs), shape=(count, count))
    joined = joined + joined.T
    return weights, sparse.diags(np.asarray(joined.sum(axis=1)).ravel()) - joined


def _cut(
    vertices: np.ndarray, triangles: np.ndarray, patch: np.ndarray, values: np.ndarray, column: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Triangles divided where ``values[:, column]`` crosses 0; new vertices lie on the crossing."""
    level = values[:, column]
    # A vertex nearly on the crossing would leave slivers: it is taken to be on its own side.
    positive = level > 0
    mixed = positive[triangles].any(axis=1) & ~positive[triangles].all(axis=1)
    places, rows = [vertices], [values]
    new: dict[tuple[int, int], int] = {}
    count = len(vertices)

    def between(a: int, b: int) -> int:
        key = (min(a, b), max(a, b))
        if key not in new:
            share = np.clip(level[key[0]] / (level[key[0]] - level[key[1]]), 0.02, 0.98)
            new[key] = count + len(new)
            places.append((1 - share) * vertices[[key[0]]] + share * vertices[[key[1]]])
            row = (1 - share) * values[[key[0]]] + share * values[[key[1]]]
            row[0, column] = 0.0
            rows.append(row)
        return new[key]

    made, of = [], []
    for index in np.flatnonzero(mixed):
        corners = [int(corner) for corner in triangles[index]]
        alone = next(
            k
            for k in range(3)
            if positive[corners[k]] not in (positive[corners[k - 1]], positive[corners[k - 2]])
        )
        a, b, c = corners[alone], corners[alone - 2], corners[alone - 1]
        ab, ac = between(a, b), between(a, c)
        made += [(a, ab, ac), (ab, b, c), (ab, c, ac)]
        of += [patch[index]] * 3
    kept = ~mixed
    return (
        np.concatenate(places),
        np.concatenate([triangles[kept], np.array(made, dtype=np.int64).reshape(-1, 3)]),
        np.concatenate([patch[kept], np.array(of, dtype=patch.dtype)]),
        np.concatenate(rows),
    )


def _without_islands(triangles: np.ndarray, chosen: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """``chosen`` (T,) bool such that it and its rest, where ``inside``, are one connected piece each."""
    found = chosen.copy()
    for wanted in (True, False):
        here = np.flatnonzero((found == wanted) & inside)
        edges = np.sort(
            np.concatenate([triangles[here][:, pair] for pair in ([0, 1], [1, 2], [2, 0])]), axis=1
        )
        owner = np.tile(np.arange(len(here)), 3)
        order = np.lexsort(edges.T)
        same = (edges[order][1:] == edges[order][:-1]).all(axis=1)
        links = (owner[order][1:][same], owner[order][:-1][same])
        graph = sparse.csr_matrix((np.ones(len(links[0])), links), shape=(len(here),) * 2)
        _, label = connected_components(graph, directed=False)
        found[here[label != np.bincount(label).argmax()]] = not wanted
    return found


def _flattened(surface: np.ndarray, triangles: np.ndarray, start: np.ndarray) -> np.ndarray:
    """(V, 2): each triangle's shape is kept as well as its neighbours allow, from ``start`` on."""
    local = _own_planes(surface, triangles)  # (T, 3, 2)
    edges = np.roll(local, -1, axis=1) - local  # edge k: from corner k to corner k + 1
    count = len(surface)
    weights, laplacian = _cotangents(local, triangles, count, _seam_weight(triangles))
    first, second = triangles, np.roll(triangles, -1, axis=1)
    held = sparse.csc_matrix(([1.0], ([0], [0])), shape=(count, count))
    solver = splu((laplacian + held).tocsc())
    # ``start`` turns the other way when it mirrors; local planes are seen from outside, y up.
    flat = start * (1.0, -1.0)
    for _ in range(_ROUNDS):
        now = flat[second] - flat[first]
        a = np.einsum("tk,tki,tki->t", weights, edges, now)
        b = np.einsum("tk,tk->t", weights, edges[..., 0] * now[..., 1] - edges[..., 1] * now[..., 0])
        size = np.maximum(np.hypot(a, b), 1e-12)
        cosine, sine = (a / size)[:, None], (b / size)[:, None]
        turned = (
            np.stack(
                [
                    cosine * edges[..., 0] - sine * edges[..., 1],
                    sine * edges[..., 0] + cosine * edges[..., 1],
                ],
                axis=2,
            )
            * weights[..., None]
        )
        right = np.zeros((count, 2))
        np.add.at(right, second.ravel(), turned.reshape(-1, 2))
        np.add.at(right, first.ravel(), -turned.reshape(-1, 2))
        right[0] += flat[0]
        flat = solver.solve(right)
    return flat * (1.0, -1.0)


def _seam_weight(triangles: np.ndarray) -> np.ndarray:
    """(T,) more beside the seam: there both pieces must fit each other."""
    border = np.concatenate(borders(triangles))
    return np.where(np.isin(triangles, border).any(axis=1), _SEAM_WEIGHT, 1.0)


def _own_planes(surface: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(T, 3, 2): each triangle in its own plane, seen from outside."""
    a, b, c = (surface[triangles[:, corner]] for corner in range(3))
    along = b - a
    length = np.maximum(np.linalg.norm(along, axis=1), 1e-9)
    x = along / length[:, None]
    side = c - a
    cx = (side * x).sum(axis=1)
    cy = np.linalg.norm(side - cx[:, None] * x, axis=1)
    zero = np.zeros(len(a))
    return np.stack(
        [np.column_stack([zero, zero]), np.column_stack([length, zero]), np.column_stack([cx, cy])], axis=1
    )
