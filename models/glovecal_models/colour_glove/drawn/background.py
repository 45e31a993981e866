"""What is behind the hand: a wall, a desk, things in all colours, and a face."""

from __future__ import annotations

import cv2
import numpy as np

SKIN_SRGB = ((236, 188, 160), (205, 150, 120), (165, 110, 80), (110, 72, 52))
"""Of four people."""
_THINGS = 14
_SATURATED = 0.3
"""Share of the things whose colour is as strong as the glove's."""


def background(width: int, height: int, rng: np.random.Generator, *, clutter: bool, face: bool) -> np.ndarray:
    """(H, W, 3) uint8 red, green, blue."""
    wall, desk = (rng.uniform(90, 210) + rng.normal(0, 8, 3) for _ in range(2))
    edge = rng.uniform(0.45, 0.75) * height
    rows = np.arange(height)[:, None, None]
    across = np.linspace(rng.uniform(0.75, 1.0), rng.uniform(0.75, 1.0), width)[None, :, None]
    picture = np.clip(np.where(rows < edge, wall, desk) * across, 0, 255).astype(np.uint8).copy()
    if face:
        _draw_face(picture, rng)
    if clutter:
        for _ in range(_THINGS):
            _draw_thing(picture, rng)
    return picture


def _draw_thing(picture: np.ndarray, rng: np.random.Generator) -> None:
    height, width = picture.shape[:2]
    if rng.random() < _SATURATED:
        hue = np.array([[[rng.integers(0, 180), rng.integers(120, 230), rng.integers(80, 240)]]], np.uint8)
        colour = cv2.cvtColor(hue, cv2.COLOR_HSV2RGB)[0, 0]
    else:
        colour = np.clip(rng.uniform(40, 220) + rng.normal(0, 25, 3), 0, 255)
    place = (int(rng.integers(0, width)), int(rng.integers(0, height)))
    reach = float(width) * 0.02 + rng.exponential(0.03 * width)
    size = (int(reach), int(reach * rng.uniform(0.3, 1.0)))
    paint = tuple(int(value) for value in colour)
    if rng.random() < 0.5:
        cv2.ellipse(picture, place, size, rng.uniform(0, 180), 0, 360, paint, -1, cv2.LINE_AA)
    else:
        corners = cv2.boxPoints((place, (2 * size[0], 2 * size[1]), rng.uniform(0, 180)))
        cv2.fillConvexPoly(picture, corners.astype(np.int32), paint, cv2.LINE_AA)


def _draw_face(picture: np.ndarray, rng: np.random.Generator) -> None:
    """Skin, hair, eyes and mouth, mostly beside the middle."""
    height, width = picture.shape[:2]
    skin = SKIN_SRGB[rng.integers(len(SKIN_SRGB))]
    hair = tuple(int(value) for value in rng.uniform(15, 90) * np.array([1.0, 0.8, 0.6]))
    u = int(width * (rng.uniform(0.05, 0.3) if rng.random() < 0.5 else rng.uniform(0.7, 0.95)))
    v, tall = int(height * rng.uniform(0.2, 0.4)), int(height * rng.uniform(0.14, 0.24))
    broad = int(0.75 * tall)
    cv2.ellipse(picture, (u, v - tall // 3), (int(1.15 * broad), tall), 0, 0, 360, hair, -1, cv2.LINE_AA)
    cv2.ellipse(picture, (u, v), (broad, tall), 0, 0, 360, skin, -1, cv2.LINE_AA)
    for side in (-1, 1):
        eye = (u + side * int(0.4 * broad), v - tall // 6)
        cv2.ellipse(picture, eye, (broad // 6, tall // 14), 0, 0, 360, (245, 245, 245), -1, cv2.LINE_AA)
        cv2.circle(picture, eye, max(1, tall // 18), (40, 30, 25), -1, cv2.LINE_AA)
    mouth = (u, v + int(0.5 * tall))
    cv2.ellipse(picture, mouth, (broad // 3, tall // 12), 0, 0, 360, (170, 80, 85), -1, cv2.LINE_AA)
