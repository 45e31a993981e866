"""Patches and colours on the skin of a hand (Wang & Popovic 2009, section 4.1).

Twenty seed triangles as far from each other as possible; every triangle belongs to the patch of its nearest
seed; each patch has one of ten colours, two patches a colour, at random. Of many draws that one is kept whose
patches of one colour are farthest apart (ours): then a colour's two places are seldom mistaken.

The ten colours of the glove, as printed: far apart from each other and from skin in any common light.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import dijkstra

from glovecal_models.colour_glove.skin import HandSkin, hand_skin
from glovecal_models.errors import BadInput

PATCHES, COLOURS = 20, 10
DRAWS = 4000
COLOUR_NAMES = (
    "red", "orange", "yellow", "lime", "green", "turquoise", "sky blue", "dark blue", "violet", "pink",
)  # fmt: skip
PRINTED_SRGB = np.array(
    [
        (196, 24, 36), (244, 120, 16), (250, 222, 30), (150, 206, 52), (16, 124, 62),
        (24, 176, 160), (70, 160, 232), (24, 50, 150), (112, 46, 146), (238, 84, 160),
    ],
    dtype=np.uint8,
)  # fmt: skip
"""(10, 3) red, green, blue; of colour 1 and so on in label images."""


@dataclass(frozen=True, eq=False)
class Pattern:
    """For the triangles of a skin."""

    patch: np.ndarray
    """(T,) uint8, 1 to P."""
    colour_of_patch: np.ndarray
    """(P,) uint8, 1 to C: of patch 1 and so on."""
    seed_distance_mm: np.ndarray
    """(P, P) over the skin at rest, between the patches' seeds."""

    @property
    def colour(self) -> np.ndarray:
        """(T,) uint8, 1 to C."""
        return self.colour_of_patch[self.patch.astype(int) - 1]

    @property
    def colours(self) -> int:
        return int(self.colour_of_patch.max())

    @property
    def same_colour_mm(self) -> float:
        """Smallest distance of two patches' seeds that have one colour; infinite when none has."""
        return _closest(self.seed_distance_mm, self.colour_of_patch)


def glove_pattern(
    skin: HandSkin, patches: int = PATCHES, colours: int = COLOURS, *, seed: int = 1, draws: int = DRAWS
) -> Pattern:
    """A pattern for ``skin``; the same arguments give the same one. One draw: the paper's own choice.

    Raises BadInput for counts that make no pattern.
    """
    if not 1 <= colours <= patches <= min(255, len(skin.triangles)) or draws < 1:
        raise BadInput(
            f"{patches} patches in {colours} colours, {draws} draws; expected 1 <= colours <= patches"
        )
    distance = _seed_distances(skin, patches)
    between = distance.distances[:, distance.seeds]
    rng = np.random.default_rng(seed)
    dealt = np.arange(patches) % colours + 1
    best = max((rng.permutation(dealt) for _ in range(draws)), key=lambda drawn: _closest(between, drawn))
    patch = (np.argmin(distance.distances, axis=0) + 1).astype(np.uint8)
    return Pattern(patch, best.astype(np.uint8), between)


@cache
def printed_pattern() -> Pattern:
    """The pattern that is printed: the assumed hand's, on the same triangles of every hand, right or left.

    A pattern drawn anew for other bones would have its borders elsewhere, up to 20 mm.
    """
    return glove_pattern(hand_skin())


@dataclass(frozen=True)
class _Seeds:
    seeds: list[int]
    distances: np.ndarray
    """(P, T), mm over the skin."""


def _seed_distances(skin: HandSkin, count: int) -> _Seeds:
    """Farthest-point choice over paths from triangle to triangle; begins at the middle fingertip."""
    centres = skin.vertices_mm[skin.triangles].mean(axis=1)
    graph = _neighbours(skin.triangles, centres)
    seeds = [int(np.argmax(centres[:, 0]))]
    rows = [dijkstra(graph, indices=seeds[0])]
    while len(seeds) < count:
        seeds.append(int(np.argmax(np.min(rows, axis=0))))
        rows.append(dijkstra(graph, indices=seeds[-1]))
    return _Seeds(seeds, np.array(rows))


def _neighbours(triangles: np.ndarray, centres: np.ndarray) -> sparse.csr_matrix:
    """Triangles that share a corner, by the distance of their centres."""
    count = len(triangles)
    rows = np.repeat(np.arange(count), 3)
    shape = (count, int(triangles.max()) + 1)
    has = sparse.csr_matrix((np.ones(3 * count), (rows, triangles.ravel())), shape=shape)
    pairs = sparse.coo_matrix(has @ has.T)
    apart = pairs.row != pairs.col
    first, second = pairs.row[apart], pairs.col[apart]
    lengths = np.linalg.norm(centres[first] - centres[second], axis=1)
    return sparse.csr_matrix((lengths, (first, second)), shape=(count, count))


def _closest(distance: np.ndarray, colour: np.ndarray) -> float:
    same = (colour[:, None] == colour[None]) & ~np.eye(len(colour), dtype=bool)
    return float(distance[same].min()) if same.any() else float("inf")


def linear_light(srgb: np.ndarray) -> np.ndarray:
    """Of values 0 to 255: the light they stand for, 0 to 1 (IEC 61966-2-1)."""
    share = np.asarray(srgb, dtype=np.float32) / 255.0
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4).astype(np.float32)


def encoded_light(light: np.ndarray) -> np.ndarray:
    """uint8 of light; the inverse of ``linear_light``, cut at white."""
    share = np.clip(light, 0.0, 1.0)
    coded = np.where(share <= 0.0031308, 12.92 * share, 1.055 * share ** (1 / 2.4) - 0.055)
    return np.rint(255.0 * coded).astype(np.uint8)
