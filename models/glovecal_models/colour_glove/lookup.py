"""A tiny image looked up: candidates by their code, ranked again by image distance, the ten nearest blended.

Wang & Popovic 2009, sections 4.5 and 5.2. The paper leaves the hand's position to inverse kinematics; here
the window's size and place already give a first one, as the entry was rendered at a known distance.

A code of 32 numbers: principal components of the pooled distance transforms.

Not in Wang & Popovic 2009: a plain alternative to their boosted bits, quicker to learn and closer to the
image distance (``do.py paper --part colour-glove`` compares them).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numba
import numpy as np

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.crop import SIZE, Window, distance_transform, distances
from glovecal_models.colour_glove.database import (
    VIEW_DISTANCE_MM,
    VIEW_FOCAL_PX,
    VIEW_PX,
    PoseDatabase,
)
from glovecal_models.colour_glove.hand_state import HandState
from glovecal_models.errors import BadInput

RERANKED, BLENDED = 300, 10
DIMENSIONS = 32
_CELL = 4
_MOST_LEARNED_ON = 5000


class Code(Protocol):
    def nearest(self, transform: np.ndarray, count: int) -> np.ndarray: ...


@dataclass(frozen=True, eq=False)
class Neighbours:
    """Entries of a database, nearest first."""

    entries: np.ndarray
    """(K,)."""
    distances: np.ndarray
    """(K,): image distances, squared pixels."""
    quarter_turns: int = 0
    """Against the clock, that the picture was turned by before it was looked up."""

    @property
    def turn(self) -> np.ndarray:
        """(3, 3): from the camera's frame to that of a camera that sees the picture as it was looked up."""
        quarter = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        return np.linalg.matrix_power(quarter, self.quarter_turns)

    @property
    def weights(self) -> np.ndarray:
        """(K,): Gaussian in the distance, its sigma the mean of the distances (equation 1); sum 1."""
        sigma = max(float(self.distances.mean()), 1e-9)
        weights = np.exp(-((self.distances / sigma) ** 2))
        return weights / weights.sum()


@dataclass(frozen=True, eq=False)
class PoseLookup:
    """``code`` None: every entry is compared (the paper's brute force)."""

    database: PoseDatabase
    code: Code | None

    def neighbours(self, tiny: np.ndarray, count: int = BLENDED, *, reranked: int = RERANKED) -> Neighbours:
        """The ``count`` nearest entries of a tiny image (40, 40) uint8.

        Raises BadInput for another kind of image, one without a glove, and counts out of range.
        """
        if not 1 <= count <= reranked:
            raise BadInput(f"{count} neighbours of {reranked} compared; expected 1 to {reranked}")
        transform = distance_transform(tiny, self.database.transforms.shape[1])
        if not tiny.any():
            raise BadInput("a tiny image without any glove pixel cannot be looked up")
        size = len(self.database)
        candidates = np.arange(size) if self.code is None else self.code.nearest(transform, reranked)
        apart = distances(tiny, transform, self.database.tiny, self.database.transforms, candidates)
        order = np.argsort(apart, kind="stable")[:count]
        return Neighbours(candidates[order], apart[order])

    def neighbours_of_any_turn(
        self, tiny: np.ndarray, near_px2: float = 0.0, turns: Sequence[int] = (0, 1, 2, 3)
    ) -> Neighbours:
        """As ``neighbours``, of the tiny image turned by quarters of a circle: whichever is nearest.

        The database holds hands whose fingers point upwards or aside; a hand that points down, or a picture
        on its side, is such a hand once it is turned. The first of ``turns`` with an entry within
        ``near_px2`` is taken.
        """
        found = []
        for quarter_turns in turns:
            each = self.neighbours(np.ascontiguousarray(np.rot90(tiny, quarter_turns)))
            found.append(replace(each, quarter_turns=quarter_turns))
            if each.distances[0] <= near_px2:
                return found[-1]
        return min(found, key=lambda each: each.distances[0])

    def blend(self, neighbours: Neighbours) -> tuple[np.ndarray, np.ndarray]:
        """Angles (20,) and rotation (3, 3) before the virtual camera: weighted means, the rotation's in the
        chordal metric."""
        weights, entries = neighbours.weights, neighbours.entries
        angles = weights @ self.database.angles_deg[entries].astype(float)
        mean = np.einsum("k,kab->ab", weights, self.database.rotations[entries].astype(float))
        left, _, right = np.linalg.svd(mean)
        flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
        return angles, left @ flip @ right

    def placed(self, neighbours: Neighbours, window: Window, camera: Camera) -> HandState:
        """The blend where ``camera`` saw it, in the camera's own frame.

        The ratio of the windows' sizes gives the distance, the window's centre the direction; along that
        direction the hand looks as it did along the virtual camera's axis.
        """
        angles, rotation = self.blend(neighbours)
        own = self.database.windows[neighbours.entries].astype(float)
        u, v, half = neighbours.weights @ own
        focal = float(np.mean(camera.focal_px))
        distance = VIEW_DISTANCE_MM * (focal / VIEW_FOCAL_PX) * (half / window.half)
        # What lay on the virtual camera's axis lies beside the window's centre by as much as it did there.
        offset = (np.full(2, (VIEW_PX - 1) / 2) - (u, v)) * (window.half / half)
        back = neighbours.turn.T
        offset, rotation = back[:2, :2] @ offset, back @ rotation
        direction = camera.undistort(np.array([[window.u, window.v]]) + offset)[0]
        ray = np.append(direction, 1.0)
        turn = _turn_from_axis(ray / np.linalg.norm(ray))
        # Depth, not distance, is what sizes in a picture tell.
        centre = turn @ np.array([0.0, 0.0, distance * np.linalg.norm(ray)])
        rotation = turn @ rotation
        return HandState(angles, rotation, centre - rotation @ self.database.palm_centre_mm)


def _turn_from_axis(direction: np.ndarray) -> np.ndarray:
    """The smallest rotation (3, 3) from the camera's z to a unit vector with positive z."""
    x, y, z = direction
    cross = np.array([[0.0, 0.0, x], [0.0, 0.0, y], [-x, -y, 0.0]])
    return np.eye(3) + cross + cross @ cross / (1.0 + z)


@dataclass(frozen=True, eq=False)
class PcaCode:
    """N codes of D numbers."""

    mean: np.ndarray
    axes: np.ndarray
    """(F, D)."""
    codes: np.ndarray
    """(N, D) float32."""

    def nearest(self, transform: np.ndarray, count: int) -> np.ndarray:
        """The ``count`` entries whose codes are nearest to that of a distance transform, nearest first."""
        query = ((_pooled(transform[None]) - self.mean) @ self.axes)[0].astype(np.float32)
        apart = _squares(self.codes, query)
        return smallest(apart, count)


def pca_code(transforms: np.ndarray, dimensions: int = DIMENSIONS) -> PcaCode:
    """Learn from at most 5,000 of the entries' distance transforms (N, C, 40, 40), and code all.

    Raises BadInput when more dimensions are asked for than entries or features give.
    """
    features = transforms.shape[1] * (SIZE // _CELL) ** 2
    if not 1 <= dimensions <= min(features, len(transforms)):
        raise BadInput(f"{dimensions} dimensions from {len(transforms)} entries of {features} features")
    sample = _pooled(np.ascontiguousarray(transforms[:: -(-len(transforms) // _MOST_LEARNED_ON)]))
    mean = sample.mean(axis=0)
    _, vectors = np.linalg.eigh((sample - mean).T @ (sample - mean))
    axes = np.ascontiguousarray(vectors[:, ::-1][:, :dimensions])
    codes = np.empty((len(transforms), dimensions), np.float32)
    for low in range(0, len(transforms), 1000):
        codes[low : low + 1000] = (_pooled(np.array(transforms[low : low + 1000])) - mean) @ axes
    return PcaCode(mean, axes, codes)


def smallest(values: np.ndarray, count: int) -> np.ndarray:
    """Indices of the ``count`` smallest, ascending; of equal ones the first."""
    count = min(count, len(values))
    bound = np.partition(values, count - 1)[count - 1]
    candidates = np.flatnonzero(values <= bound)
    return candidates[np.argsort(values[candidates], kind="stable")][:count]


@numba.njit(cache=True)
def _squares(codes, query):  # type: ignore[no-untyped-def]
    found = np.empty(len(codes), dtype=np.float32)
    for entry in range(len(codes)):
        total = np.float32(0.0)
        for dimension in range(len(query)):
            difference = codes[entry, dimension] - query[dimension]
            total += difference * difference
        found[entry] = total
    return found


@numba.njit(cache=True)
def _pooled(transforms):  # type: ignore[no-untyped-def]
    """(N, C * 100): the root of the mean over cells of 4 x 4, in pixels."""
    count, colours, size = transforms.shape[:3]
    across = size // _CELL
    found = np.empty((count, colours * across * across))
    for entry in range(count):
        for colour in range(colours):
            for row in range(across):
                for column in range(across):
                    total = 0
                    for y in range(row * _CELL, (row + 1) * _CELL):
                        for x in range(column * _CELL, (column + 1) * _CELL):
                            total += transforms[entry, colour, y, x]
                    place = (colour * across + row) * across + column
                    found[entry, place] = np.sqrt(total / _CELL**2)
    return found
