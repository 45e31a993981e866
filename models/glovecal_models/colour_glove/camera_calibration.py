"""A camera from pictures of the calibration board: focal length, centre, lens distortion; where others stand.

Z. Zhang 2000, "A flexible new technique for camera calibration", IEEE PAMI 22(11), 1330-1334, as OpenCV
does it, with Brown's distortion. Standard deviations are those that the spread of the corners' errors
implies. Another camera's place comes from moments in which both saw the board; its deviation is found by
leaving each moment out once (the jackknife).

Pictures of the calibration board: where its corners are, and which pictures are good enough.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from glovecal_models.colour_glove.camera_model import Camera
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
FEWEST_VIEWS, GOOD_VIEWS = 8, 20
FEWEST_SHARED_VIEWS, FEWEST_SHARED_CORNERS = 5, 6
LEAST_SURE_FOCAL = 0.01
"""Standard deviation of the focal length over the focal length; above, the views do not fix it."""
WORST_RMS_PX = 2.0
FEWEST_TILTED, TILTED_DEPTH = 4, 0.08
"""Views whose board reaches away by this share of its distance. Without such the focal length is anything,
and its standard deviation does not show it."""


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


@dataclass(frozen=True)
class CameraCalibration:
    """A camera and how well it is known."""

    camera: Camera
    rms_px: float
    """Of the corners, between picture and camera."""
    focal_sd_px: tuple[float, float]
    centre_sd_px: tuple[float, float]
    distortion_sd: tuple[float, ...]
    view_rms_px: tuple[tuple[str, float], ...]
    """Of each view by name, worst first."""
    covered: float
    """Share of the picture inside the convex hull of all corners: outside, distortion is extrapolated."""


@dataclass(frozen=True)
class CameraPlacement:
    """A camera with its pose relative to the first one."""

    camera: Camera
    rms_px: float
    turn_sd_deg: float
    place_sd_mm: float
    views: int
    """That both cameras saw."""


def calibrate_camera(views: Sequence[BoardView], board: CalibrationBoard) -> CameraCalibration:
    """From about ``GOOD_VIEWS`` views, tilted and all over the picture. The camera stands at the origin.

    Raises BadInput, which says what to do, for too few views, views of several sizes, and views that leave
    the focal length open.
    """
    if len(views) < FEWEST_VIEWS:
        raise BadInput(
            f"{len(views)} good views of the board; at least {FEWEST_VIEWS} are needed, {GOOD_VIEWS} are good"
        )
    size = views[0].size
    for view in views:
        if view.size != size:
            raise BadInput(
                f"{view.name} has {view.size[0]} x {view.size[1]} pixels, {views[0].name} "
                f"{size[0]} x {size[1]}; a camera is calibrated at one size"
            )
    tilted = sum(_depth_share(view, board) > TILTED_DEPTH for view in views)
    if tilted < FEWEST_TILTED:
        raise BadInput(
            f"the board is tilted in {tilted} of {len(views)} views, at least {FEWEST_TILTED} are "
            f"needed. {_TILT}"
        )
    solid = [_solid(board, view.ids) for view in views]
    flat = [view.corners_px.astype(np.float32).reshape(-1, 1, 2) for view in views]
    start = np.array(
        [[size[0], 0, (size[0] - 1) / 2], [0, size[0], (size[1] - 1) / 2], [0, 0, 1]], dtype=float
    )
    try:
        rms, matrix, distortion, _, _, deviations, _, of_view = cv2.calibrateCameraExtended(
            solid, flat, size, start, np.zeros(5), flags=cv2.CALIB_USE_INTRINSIC_GUESS
        )
    except cv2.error as error:
        raise BadInput(f"these views make no camera ({error.err}). {_TILT}") from error
    deviation = np.ravel(deviations)[:9]
    focal = (float(matrix[0, 0]), float(matrix[1, 1]))
    unsure = float(np.max(deviation[:2] / focal)) if np.isfinite(deviation).all() else float("inf")
    if not unsure < LEAST_SURE_FOCAL:
        raise BadInput(
            f"these views leave the focal length open by {unsure:.1%} (standard deviation; at most "
            f"{LEAST_SURE_FOCAL:.0%}). {_TILT}"
        )
    order = np.argsort(-np.ravel(of_view))
    worst = views[int(order[0])].name
    if rms > WORST_RMS_PX:
        raise BadInput(
            f"corners are off by {rms:.1f} pixels (RMS; at most {WORST_RMS_PX:g}), most in {worst}. Is the "
            "board flat, and was neither zoom nor focus changed between pictures?"
        )
    camera = Camera(
        width=size[0],
        height=size[1],
        focal_px=focal,
        centre_px=(float(matrix[0, 2]), float(matrix[1, 2])),
        distortion=_five(np.ravel(distortion)),
    )
    hull = cv2.convexHull(np.concatenate(flat))
    return CameraCalibration(
        camera,
        float(rms),
        (float(deviation[0]), float(deviation[1])),
        (float(deviation[2]), float(deviation[3])),
        _five(deviation[4:]),
        tuple((views[index].name, float(np.ravel(of_view)[index])) for index in order),
        float(cv2.contourArea(hull) / (size[0] * size[1])),
    )


def place_camera(
    first: CameraCalibration,
    first_views: Sequence[BoardView],
    other: CameraCalibration,
    other_views: Sequence[BoardView],
    board: CalibrationBoard,
) -> CameraPlacement:
    """Where ``other`` stands, from views of the same name that both cameras took at one moment.

    Deviations of turn and place are from leaving out moments, and from lenses that differ from the calibrated
    ones as their deviations say; most comes from the lenses' centres.

    Raises BadInput when too few moments show the board to both.
    """
    by_name = {view.name: view for view in other_views}
    pairs = []
    for view in first_views:
        if view.name in by_name:
            its = by_name[view.name]
            ids, mine, theirs = np.intersect1d(view.ids, its.ids, return_indices=True)
            if len(ids) >= FEWEST_SHARED_CORNERS:
                points = (view.corners_px[mine], its.corners_px[theirs])
                pairs.append((_solid(board, ids), *(p.astype(np.float32).reshape(-1, 1, 2) for p in points)))
    if len(pairs) < FEWEST_SHARED_VIEWS:
        raise BadInput(
            f"both cameras saw the board in {len(pairs)} pictures of the same name; at least "
            f"{FEWEST_SHARED_VIEWS} are needed. Hold the board where both see it, facing between them"
        )
    lenses = (first.camera, other.camera)
    rms, rotation, translation = _placed(pairs, *lenses)
    rest = [[*pairs[:k], *pairs[k + 1 :]] for k in range(len(pairs))]
    rng = np.random.default_rng(1)
    left_out = [_placed(each, *lenses)[1:] for each in rest]
    redrawn = [_placed(pairs, _redrawn(first, rng), _redrawn(other, rng))[1:] for _ in range(_DRAWS)]
    turn_sd, place_sd = (
        float(np.hypot(_jackknife_sd(moments), np.sqrt((drawn**2).sum(axis=1).mean())))
        for moments, drawn in zip(
            _away(left_out, rotation, translation), _away(redrawn, rotation, translation), strict=True
        )
    )
    camera = replace(
        other.camera,
        rotation=tuple(tuple(float(value) for value in row) for row in rotation),
        translation_mm=(float(translation[0]), float(translation[1]), float(translation[2])),
    )
    return CameraPlacement(camera, rms, float(np.degrees(turn_sd)), place_sd, len(pairs))


_DRAWS = 20
"""Of lenses, for the deviations of another camera's pose."""
_TILT = (
    "Tilt the board by 20 to 45 degrees to all four sides, and bring it near enough to fill a third "
    "of the picture"
)


def _placed(
    pairs: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]], first: Camera, other: Camera
) -> tuple[float, np.ndarray, np.ndarray]:
    """RMS in pixels, rotation (3, 3) and translation (3,) of ``other`` from ``first``."""
    solid, mine, theirs = (list(each) for each in zip(*pairs, strict=True))
    rms, _, _, _, _, rotation, translation, _, _ = cv2.stereoCalibrate(
        solid, mine, theirs, _matrix(first), np.array(first.distortion), _matrix(other),
        np.array(other.distortion), (first.width, first.height), flags=cv2.CALIB_FIX_INTRINSIC,
    )  # fmt: skip
    left, _, right = np.linalg.svd(rotation)
    return float(rms), left @ right, np.ravel(translation)


def _redrawn(known: CameraCalibration, rng: np.random.Generator) -> Camera:
    """A lens as it may be as well. Both focal lengths err together: so does the board's distance."""
    scale, across, down = rng.normal(size=3)
    (fx, fy), (cu, cv) = known.camera.focal_px, known.camera.centre_px
    (sx, sy), (su, sv) = known.focal_sd_px, known.centre_sd_px
    focal, centre = (fx + scale * sx, fy + scale * sy), (cu + across * su, cv + down * sv)
    return replace(known.camera, focal_px=focal, centre_px=centre)


def _away(
    found: Sequence[tuple[np.ndarray, np.ndarray]], rotation: np.ndarray, translation: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Turns (N, 3) in radians and shifts (N, 3) in mm from the pose given."""
    turns = np.array([np.ravel(cv2.Rodrigues(turn @ rotation.T)[0]) for turn, _ in found])
    return turns, np.array([place for _, place in found]) - translation


def _depth_share(view: BoardView, board: CalibrationBoard) -> float:
    """How much farther the board's farthest corner is than its nearest, by the view's homography: the
    camera need not be known."""
    homography, _ = cv2.findHomography(_solid(board, view.ids)[:, :2], view.corners_px)
    if homography is None:
        return 0.0
    width, height = board.size_mm
    depth = homography[2] @ np.array([[0, width, width, 0], [0, 0, height, height], [1, 1, 1, 1]])
    return float(depth.max() / depth.min() - 1) if depth.min() > 0 else 0.0


def _jackknife_sd(values: np.ndarray) -> float:
    """Of a vector (N, 3): length of its deviation."""
    count = len(values)
    return float(np.sqrt((count - 1) / count * ((values - values.mean(axis=0)) ** 2).sum()))


def _matrix(camera: Camera) -> np.ndarray:
    (fx, fy), (cu, cv) = camera.focal_px, camera.centre_px
    return np.array([[fx, 0, cu], [0, fy, cv], [0, 0, 1]])


def _solid(board: CalibrationBoard, ids: np.ndarray) -> np.ndarray:
    points = np.asarray(board.opencv.getChessboardCorners(), dtype=np.float32).reshape(-1, 3)
    return points[ids]


def _five(values: np.ndarray) -> tuple[float, float, float, float, float]:
    k1, k2, p1, p2, k3 = (float(value) for value in values[:5])
    return k1, k2, p1, p2, k3
