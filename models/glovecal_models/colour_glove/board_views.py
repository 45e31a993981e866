"""Pictures of the calibration board: where its corners are, and which pictures are good enough."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from glovecal_models.colour_glove.sheets.calibration_board import CalibrationBoard
from glovecal_models.errors import BadInput

FEWEST_CORNERS = 8
"""Of 24."""
BLURRED_PX = 2.0
"""Standard deviation of the blur from which a picture is refused: like 5 pixels of motion blur."""
STILL_PX = 0.7
"""A board that moves less from one picture to the next is held still."""
NEW_SHARE = 0.04
"""Of the picture's width: corners of a new view lie farther than this from those of each before."""
_SMOOTHED_PX = 1.0


@dataclass(frozen=True, eq=False)
class BoardView:
    """One picture of the board."""

    name: str
    """The same for pictures that several cameras took at one moment."""
    size: tuple[int, int]
    """Width and height of the picture, pixels."""
    ids: np.ndarray
    """(N,) which corners were found, ascending."""
    corners_px: np.ndarray
    """(N, 2)."""
    blur_px: float
    """Standard deviation of the blur across the board's edges, in the worse direction."""


def board_view(picture: np.ndarray, board: CalibrationBoard, name: str) -> BoardView:
    """The board in a picture (H, W, 3) or (H, W) uint8. Raises BadInput that names the picture and says what
    to do: no board, too little of it, blurred."""
    if picture.dtype != np.uint8 or picture.ndim not in (2, 3) or not picture.size:
        raise BadInput(f"{name} is no picture: {picture.shape} {picture.dtype}")
    grey = picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    corners, ids, _, _ = cv2.aruco.CharucoDetector(board.opencv).detectBoard(grey)
    count = 0 if ids is None else len(ids)
    if not count:
        raise BadInput(
            f"{name}: no board is seen. Bring it nearer, hold it still, light it evenly, avoid shine on it"
        )
    if count < FEWEST_CORNERS:
        raise BadInput(
            f"{name}: {count} of the board's {board.corners} corners are seen, at least {FEWEST_CORNERS} are "
            "needed. Show more of it, nearer and less tilted"
        )
    order = np.argsort(np.ravel(ids))
    found_ids, found = np.ravel(ids)[order].astype(int), np.reshape(corners, (-1, 2))[order].astype(float)
    blur = _blur_px(grey, board, found_ids, found)
    if blur > BLURRED_PX:
        raise BadInput(
            f"{name}: blurred, edges are {blur:.1f} pixels wide (standard deviation; at most "
            f"{BLURRED_PX:g}). Hold the board still, add light, or focus"
        )
    return BoardView(name, (grey.shape[1], grey.shape[0]), found_ids, found, blur)


def board_views(
    pictures: Iterable[tuple[str, np.ndarray]], board: CalibrationBoard
) -> tuple[list[BoardView], list[str]]:
    """Views of those pictures that are good, and a sentence for each other."""
    found, refused = [], []
    for name, picture in pictures:
        try:
            found.append(board_view(picture, board, name))
        except BadInput as error:
            refused.append(str(error))
    return found, refused


class ViewCollector:
    """Chooses views from running cameras: the board held still, in a place where it was not yet."""

    def __init__(self, board: CalibrationBoard, cameras: int = 1) -> None:
        self._board = board
        self.views: list[list[BoardView]] = [[] for _ in range(cameras)]
        """Of each camera; equally many."""
        self._before: list[BoardView] | None = None

    def offer(self, pictures: Sequence[np.ndarray], name: str) -> str | None:
        """Pictures of one moment, one a camera. Why they were not taken; None: they were."""
        try:
            seen = [board_view(picture, self._board, name) for picture in pictures]
        except BadInput as error:
            self._before = None
            return str(error)
        before, self._before = self._before, seen
        if before is None or any(_moved_px(a, b) > STILL_PX for a, b in zip(before, seen, strict=True)):
            return f"{name}: hold the board still"
        for kept in zip(*self.views, strict=True):
            if all(_moved_px(a, b) < NEW_SHARE * b.size[0] for a, b in zip(kept, seen, strict=True)):
                return f"{name}: move or tilt the board"
        for views, view in zip(self.views, seen, strict=True):
            views.append(view)
        return None


def _moved_px(first: BoardView, second: BoardView) -> float:
    """Root mean square over the corners both show; infinite when they share none."""
    _, of_first, of_second = np.intersect1d(first.ids, second.ids, return_indices=True)
    if not len(of_first):
        return float("inf")
    moved = first.corners_px[of_first] - second.corners_px[of_second]
    return float(np.sqrt((moved**2).sum(axis=1).mean()))


def _blur_px(grey: np.ndarray, board: CalibrationBoard, ids: np.ndarray, corners: np.ndarray) -> float:
    """An edge of contrast c, blurred by s, rises by c / (s sqrt(2 pi)) a pixel at most."""
    places = np.asarray(board.opencv.getChessboardCorners(), dtype=float).reshape(-1, 3)[ids, :2]
    affine, *_ = np.linalg.lstsq(np.column_stack([places, np.ones(len(places))]), corners, rcond=None)
    square_px = np.linalg.norm(affine[:2], axis=1) * board.square_mm
    directions = affine[:2] / np.maximum(np.linalg.norm(affine[:2], axis=1, keepdims=True), 1e-9)
    smooth = cv2.GaussianBlur(grey, (0, 0), _SMOOTHED_PX).astype(np.float32)
    gradient = [cv2.Sobel(smooth, cv2.CV_32F, 1 - axis, axis, scale=1 / 8) for axis in (0, 1)]
    reach = int(np.clip(0.3 * square_px.min(), 3, 25))
    found = []
    for u, v in np.rint(corners).astype(int):
        rows, columns = slice(max(0, v - reach), v + reach + 1), slice(max(0, u - reach), u + reach + 1)
        around = smooth[rows, columns]
        if min(around.shape) < 5:
            continue
        contrast = float(np.ptp(around))
        steepest = [
            float(np.abs(x * gradient[0][rows, columns] + y * gradient[1][rows, columns]).max())
            for x, y in directions
        ]
        found.append(max(contrast / (np.sqrt(2 * np.pi) * max(rise, 1e-3)) for rise in steepest))
    wide = float(np.median(found)) if found else 0.0
    return float(np.sqrt(max(0.0, wide**2 - _SMOOTHED_PX**2)))
