"""Which of the glove's colours each pixel shows: Gaussian mixtures, learned from a few labelled pictures.

Wang & Popovic 2009, section 4.3: a bilateral filter takes noise and weave away, then one mixture of three
Gaussians per colour decides, in a logarithmic space where light of another strength is a shift. With full
covariances any linear change of that space is the same, so that of Chong et al. 2008 needs no copy. What is
no glove has a mixture of its own (ours). All is kept as a table of 64 x 64 x 64 colours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from zipfile import ZipFile

import cv2
import numba
import numpy as np

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.pattern import Pattern
from glovecal_models.colour_glove.photograph import labelled_photographs
from glovecal_models.colour_glove.skin import HandSkin
from glovecal_models.documents import UNREADABLE_ARCHIVE
from glovecal_models.errors import BadInput

LEVELS = 64
COMPONENTS, BACKGROUND_COMPONENTS = 3, 12
_LARGEST_TABLE = LEVELS**3 + 1024
_LOG_OFFSET = 8.0
_ROUNDS = 40
_MOST_PIXELS = 4000
"""Of one colour, to learn from."""
_LEAST_OF_A_COLOUR = 30
_FLOOR = 0.02
"""Least standard deviation along any direction, in logarithms."""
_BACKGROUND_SHARE = 0.2
"""Prior of no glove."""
_FARTHEST = 5.0
"""Standard deviations from every component of its colour, beyond which a pixel is no glove."""
_LIKELY_SHARE, _LIKELY_FARTHEST = 0.005, 9.0
"""The same two where glove is all around: a shadow or a highlight darkens or pales what was learned."""
_AROUND = 1 / 40
"""Of the picture's width: a gap that glove is around; fingers are as wide."""
FILTER_PX, FILTER_LEVELS = 5, 30.0
"""Diameter of the bilateral filter, and the difference of colour that it does not cross."""
_LEAST_COLOURS = 3
"""Of one area: a thing of the room has one or two."""


@dataclass(frozen=True, eq=False)
class ColourTable:
    labels_of: np.ndarray
    """(64, 64, 64) uint8 by blue, green, red: a colour of the glove, or 0."""
    likely_of: np.ndarray
    """The same, where glove is around: hardly anything else is to be expected there."""

    @classmethod
    def trained(
        cls, pictures: Sequence[np.ndarray], label_images: Sequence[np.ndarray], *, seed: int = 1
    ) -> ColourTable:
        """From pictures (H, W, 3) uint8 blue, green, red and labels (H, W) uint8 of the same sizes.

        Raises BadInput for arrays that do not fit, and for a colour that too few pixels have.
        """
        if len(pictures) != len(label_images) or not len(pictures):
            raise BadInput(f"{len(pictures)} pictures and {len(label_images)} label images to learn from")
        features, labels = [], []
        for picture, label in zip(pictures, label_images, strict=True):
            _require_picture(picture)
            if label.shape != picture.shape[:2] or label.dtype != np.uint8:
                raise BadInput(f"labels {label.shape} {label.dtype} of a picture {picture.shape}")
            inside = _away_from_edges(label)
            features.append(_features(smoothed(picture)[inside]))
            labels.append(label[inside])
        points, label = np.concatenate(features), np.concatenate(labels)
        rng = np.random.default_rng(seed)
        grid = np.stack(
            np.meshgrid(*[(np.arange(LEVELS) + 0.5) * (256 / LEVELS)] * 3, indexing="ij"), axis=-1
        )
        cells = _features(grid.reshape(-1, 3))
        best, table = np.full((2, len(cells)), -np.inf), np.zeros((2, len(cells)), np.uint8)
        colours = max(int(image.max()) for image in label_images)
        for colour in range(colours + 1):
            own = points[label == colour]
            if len(own) < _LEAST_OF_A_COLOUR:
                raise BadInput(
                    f"{len(own)} pixels of colour {colour} in the labelled pictures; "
                    f"at least {_LEAST_OF_A_COLOUR} are needed"
                )
            own = own[rng.permutation(len(own))[:_MOST_PIXELS]]
            mixture = _Mixture.fitted(own, COMPONENTS if colour else BACKGROUND_COMPONENTS, rng)
            density, apart = mixture.log_density(cells)
            for strict, (background, farthest) in enumerate(
                ((_LIKELY_SHARE, _LIKELY_FARTHEST), (_BACKGROUND_SHARE, _FARTHEST))
            ):
                share = background if colour == 0 else (1.0 - background) / colours
                score = density + np.log(share)
                if colour:
                    score = np.where(apart <= farthest, score, -np.inf)
                table[strict][score > best[strict]] = colour
                best[strict] = np.maximum(best[strict], score)
        likely, labels_of = table.reshape(2, LEVELS, LEVELS, LEVELS)
        return cls(labels_of, likely)

    def labels(self, picture: np.ndarray) -> np.ndarray:
        """(H, W) uint8. Areas of fewer than three colours are no glove. Raises BadInput for no picture."""
        _require_picture(picture)
        picture = smoothed(picture)
        labels = many_coloured(looked_up(picture, self.labels_of))
        around = np.ones((2 * round(_AROUND * picture.shape[1] / 2) + 1,) * 2, np.uint8)
        inside = cv2.morphologyEx((labels > 0).astype(np.uint8), cv2.MORPH_CLOSE, around) > 0
        unclear = inside & (labels == 0)
        labels = np.where(unclear, looked_up(picture, self.likely_of), labels)
        return with_edges(picture, labels)

    def save(self, file: Path) -> None:
        with file.open("wb") as stream:
            np.savez_compressed(stream, labels_of=self.labels_of, likely_of=self.likely_of)

    @classmethod
    def load(cls, file: Path) -> ColourTable:
        """Raises BadInput for a file that holds something else."""
        try:
            with ZipFile(file) as archive:
                if any(each.file_size > _LARGEST_TABLE for each in archive.infolist()):
                    raise BadInput(
                        f"{file.name} holds more than a table of colours; glovecal camera colours makes one"
                    )
            with file.open("rb") as stream, np.load(stream, allow_pickle=False) as held:
                table = held["labels_of"]
                # Tables of earlier versions tell nothing more where glove is around.
                likely = held["likely_of"] if "likely_of" in held.files else table
        except BadInput:
            raise
        except UNREADABLE_ARCHIVE as error:
            raise BadInput(
                f"{file.name} holds no table of colours that can be read; glovecal camera colours makes one"
            ) from error
        for each in (table, likely):
            if each.shape != (LEVELS,) * 3 or each.dtype != np.uint8:
                raise BadInput(f"{file.name} holds a table {each.shape} {each.dtype}, not 64 x 64 x 64 uint8")
        return cls(table, likely)


def drawn_colours(
    skin: HandSkin,
    pattern: Pattern,
    *,
    inks: np.ndarray | None = None,
    gains: tuple[float, float, float] = (1.0, 1.0, 1.0),
) -> ColourTable:
    """The table of colours learned from ``labelled_photographs`` before the camera assumed.

    What a strong light cuts off at the end of a channel no correction brings back, but a table learned in
    such light (``gains``) knows how the colours look.
    """
    examples = labelled_photographs(skin, pattern, Camera(), inks=inks, gains=gains)
    return ColourTable.trained([each.picture for each in examples], [each.labels for each in examples])


def smoothed(picture: np.ndarray) -> np.ndarray:
    return cv2.bilateralFilter(picture, FILTER_PX, FILTER_LEVELS, FILTER_PX)


@numba.njit(cache=True)
def looked_up(picture, table):  # type: ignore[no-untyped-def]
    found = np.empty(picture.shape[:2], dtype=np.uint8)
    for row in range(picture.shape[0]):
        for column in range(picture.shape[1]):
            found[row, column] = table[
                picture[row, column, 0] >> 2, picture[row, column, 1] >> 2, picture[row, column, 2] >> 2
            ]
    return found


def many_coloured(labels: np.ndarray) -> np.ndarray:
    """Only the areas of glove colours, joined at half the resolution, that show at least three of them."""
    coarse = np.ascontiguousarray(labels[::2, ::2])
    joined = cv2.dilate((coarse > 0).astype(np.uint8), np.ones((3, 3), np.uint8))
    count, areas = cv2.connectedComponents(joined, connectivity=8, ltype=cv2.CV_32S)
    kept = colours_of_areas(coarse, areas, count) >= _LEAST_COLOURS
    kept[0] = False
    mask = np.take(kept, np.asarray(areas, dtype=np.int64)).astype(np.uint8)
    height, width = labels.shape
    return labels * cv2.resize(mask, (width, height), interpolation=cv2.INTER_NEAREST)


@numba.njit(cache=True)
def colours_of_areas(labels, areas, count):  # type: ignore[no-untyped-def]
    """Kernel: how many colours each area has; one counts from a fiftieth of the area's glove pixels on."""
    pixels = np.zeros((count, 256), dtype=np.int64)
    for row in range(labels.shape[0]):
        for column in range(labels.shape[1]):
            if labels[row, column]:
                pixels[areas[row, column], labels[row, column]] += 1
    found = np.zeros(count, dtype=np.int64)
    for area in range(count):
        total = pixels[area].sum()
        for colour in range(1, 256):
            if pixels[area, colour] * 50 > total and pixels[area, colour] >= 3:
                found[area] += 1
    return found


def with_edges(picture: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Labels (H, W) with the pixels along edges given to the side they look more like.

    What lies between two patches, or between glove and background, is a mixture of both and may look like a
    third colour, or like none: the lens mixes neighbours, and JPEG keeps colours at half the resolution. So a
    pixel whose neighbours are not all of its label, and one without a label up to ``_EDGE_PX`` from one that
    has one, takes the label of the most similar pixel around it that is no mixture: one whose neighbours
    agree, or one farther from the glove than that.
    """
    neighbours = np.ones((3, 3), np.uint8)
    glove = (labels > 0).astype(np.uint8)
    near = cv2.dilate(glove, np.ones((2 * _EDGE_PX + 1,) * 2, np.uint8)) > 0
    beyond = cv2.dilate(glove, np.ones((2 * _EDGE_PX + 3,) * 2, np.uint8)) == 0
    inner = (labels > 0) & (cv2.erode(labels, neighbours) == cv2.dilate(labels, neighbours))
    rows, columns = np.nonzero(near & ~inner)
    return most_alike(picture, labels, inner | beyond, rows, columns)


_EDGE_PX = 3
"""How far an edge's colours reach, at the working size."""
_ALIKE_PX = 5
"""How far away the pixel is looked for that is most alike."""


@numba.njit(cache=True)
def most_alike(picture, labels, pure, rows, columns):  # type: ignore[no-untyped-def]
    """Kernel: labels where each pixel listed has that of the most similar ``pure`` (H, W) one around it, or
    its own where there is none."""
    height, width = labels.shape
    found = labels.copy()
    for index in range(len(rows)):
        row, column = rows[index], columns[index]
        blue, green, red = picture[row, column]
        best = 1 << 30
        for v in range(max(0, row - _ALIKE_PX), min(height, row + _ALIKE_PX + 1)):
            for u in range(max(0, column - _ALIKE_PX), min(width, column + _ALIKE_PX + 1)):
                if not pure[v, u]:
                    continue
                a = int(blue) - int(picture[v, u, 0])
                b = int(green) - int(picture[v, u, 1])
                c = int(red) - int(picture[v, u, 2])
                apart = a * a + b * b + c * c
                if apart < best:
                    best, found[row, column] = apart, labels[v, u]
    return found


@dataclass(frozen=True, eq=False)
class _Mixture:
    """K Gaussians of full covariance."""

    shares: np.ndarray
    means: np.ndarray
    covariances: np.ndarray

    @classmethod
    def fitted(cls, points: np.ndarray, count: int, rng: np.random.Generator) -> _Mixture:
        """By expectation maximisation, from means as far apart as k-means++ draws them."""
        means = points[[rng.integers(len(points))]]
        while len(means) < count:
            square = ((points[:, None] - means[None]) ** 2).sum(axis=2).min(axis=1) + 1e-12
            means = np.concatenate([means, points[[rng.choice(len(points), p=square / square.sum())]]])
        floor = _FLOOR**2 * np.eye(points.shape[1])
        start = np.cov(points.T) / count + floor
        found = cls(np.full(count, 1.0 / count), means, np.tile(start, (count, 1, 1)))
        for _ in range(_ROUNDS):
            each, _ = found._each(points)
            each -= each.max(axis=1, keepdims=True)
            member = np.exp(each)
            member /= member.sum(axis=1, keepdims=True)
            weight = member.sum(axis=0) + 1e-9
            means = (member.T @ points) / weight[:, None]
            away = points[:, None] - means[None]
            covariances = np.einsum("nk,nka,nkb->kab", member, away, away) / weight[:, None, None] + floor
            found = cls(weight / weight.sum(), means, covariances)
        return found

    def log_density(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(N,), and the smallest Mahalanobis distance to a component (N,)."""
        each, squares = self._each(points)
        most = each.max(axis=1)
        total = most + np.log(np.exp(each - most[:, None]).sum(axis=1))
        return total, np.sqrt(squares.min(axis=1))

    def _each(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        densities, squares = np.empty((2, len(points), len(self.means)))
        for index, (share, mean, covariance) in enumerate(
            zip(self.shares, self.means, self.covariances, strict=True)
        ):
            root = np.linalg.cholesky(covariance)
            scaled = np.linalg.solve(root, (points - mean).T)
            squares[:, index] = (scaled**2).sum(axis=0)
            half = np.log(np.diag(root)).sum() + 0.5 * points.shape[1] * np.log(2 * np.pi)
            densities[:, index] = np.log(share + 1e-300) - half - 0.5 * squares[:, index]
        return densities, squares


def _features(colours: np.ndarray) -> np.ndarray:
    return np.log(np.asarray(colours, dtype=float) + _LOG_OFFSET)


def _away_from_edges(labels: np.ndarray) -> np.ndarray:
    """Where all neighbours have the same label: on an edge colours mix."""
    around = np.ones((3, 3), np.uint8)
    return cv2.erode(labels, around) == cv2.dilate(labels, around)


def _require_picture(picture: np.ndarray) -> None:
    if picture.ndim != 3 or picture.shape[2] != 3 or picture.dtype != np.uint8:
        raise BadInput(f"a picture is (H, W, 3) uint8, not {picture.shape} {picture.dtype}")
