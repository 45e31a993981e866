"""Pictures of the calibration board drawn through a camera: perspective, lens distortion, blur and noise.

Rays come from ``Camera.undistort`` and meet the board's plane; nothing of OpenCV's camera is used.
"""

from __future__ import annotations

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.sheets.calibration_board import CalibrationBoard

FINE = 2
"""Rays a pixel, along each side."""
_TEXELS_OF_MM = 6
_RIM_MM = 12.0


class BoardRoom:
    """A board before one camera. Poses are of the board in the frame that the camera stands in."""

    def __init__(self, camera: Camera, board: CalibrationBoard | None = None) -> None:
        self.camera, self.board = camera, board or CalibrationBoard()
        finer = camera.scaled(FINE)
        v, u = np.mgrid[: finer.height, : finer.width]
        flat = finer.undistort(np.column_stack([u.ravel(), v.ravel()]).astype(float))
        self._rays = np.column_stack([flat, np.ones(len(flat))]).astype(np.float32)
        width, height = self.board.size_mm
        size = (round((height + 2 * _RIM_MM) * _TEXELS_OF_MM), round((width + 2 * _RIM_MM) * _TEXELS_OF_MM))
        self._paper = np.full(size, 225, np.uint8)
        for x, y, w, h in self.board.black_boxes_mm():
            left, top, right, bottom = (
                round((value + _RIM_MM) * _TEXELS_OF_MM) for value in (x, y, x + w, y + h)
            )
            self._paper[top:bottom, left:right] = 28

    def picture(
        self, rotation: np.ndarray, place_mm: np.ndarray, rng: np.random.Generator, *,
        blur_px: float = 0.7, motion_px: int = 0, noise: float = 3.0,
    ) -> np.ndarray:  # fmt: skip
        """(H, W, 3) uint8. ``rotation`` (3, 3), ``place_mm`` (3,): of the board's upper left corner."""
        turn = np.array(self.camera.rotation) @ rotation
        place = np.array(self.camera.rotation) @ place_mm + np.array(self.camera.translation_mm)
        across, down, ahead = (self._rays @ turn.astype(np.float32)).T
        reach = np.float32(turn[:, 2] @ place) / ahead
        corner = place @ turn
        on_board = np.stack([across * reach - corner[0], down * reach - corner[1]])
        fine = (self.camera.height * FINE, self.camera.width * FINE)
        x, y = ((on_board + _RIM_MM) * _TEXELS_OF_MM - 0.5).astype(np.float32).reshape(2, *fine)
        shown = cv2.remap(
            self._paper, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=(120,)
        ).astype(np.float32)
        shown[~((reach > 0) & np.isfinite(reach)).reshape(fine)] = 120
        shown = shown.reshape(self.camera.height, FINE, self.camera.width, FINE).mean(axis=(1, 3))
        if motion_px:
            shown = cv2.blur(shown, (motion_px, 1))
        shown = cv2.GaussianBlur(shown, (0, 0), blur_px) if blur_px else shown
        coloured = shown[..., None] + rng.normal(0.0, noise, (*shown.shape, 3))
        return np.clip(np.rint(coloured), 0, 255).astype(np.uint8)


def board_poses(
    board: CalibrationBoard, count: int, rng: np.random.Generator, *, tilt_deg: float = 40.0,
    distance_mm: tuple[float, float] = (330.0, 520.0), aside: float = 0.38,
) -> list[tuple[np.ndarray, np.ndarray]]:  # fmt: skip
    """Poses of a board held before a camera, tilted and moved aside by shares of the distance."""
    found = []
    middle = np.array([*board.size_mm, 0.0]) / 2
    for _ in range(count):
        turn = Rotation.from_euler("xyz", rng.uniform(-1, 1, 3) * (tilt_deg, tilt_deg, 25.0), degrees=True)
        away = rng.uniform(*distance_mm)
        x, y = rng.uniform(-1, 1, 2) * aside * away * np.array([1.0, 0.7])
        rotation = turn.as_matrix()
        found.append((rotation, np.array([x, y, away]) - rotation @ middle))
    return found
