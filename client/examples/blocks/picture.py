"""Blocks and hand as a drawing, seen from above the person's side of the desk, far things first."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from stream.drawing import PALE, Drawing
from stream.hand_drawing import COLOURS, EDGE, THICKNESS_MM, bones_of

from blocks.desk import DESK_FROM_HAND, EDGE_MM, SKELETON, Scene

VIEW = np.array([[0.87, -0.5, 0.0], [0.26, 0.45, 0.85], [-0.43, -0.74, 0.52]])
"""Rows: right, up, towards the eye, in the desk's frame."""
WOOD = np.array([214, 170, 110])
_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * EDGE_MM
_FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def desk_drawing(scene: Scene, words: str = "", width: float = 900, height: float = 520) -> Drawing:
    drawing, scale = Drawing(width, height), 1.45 * width / 900

    def flat(points_mm: np.ndarray) -> np.ndarray:
        seen = points_mm @ VIEW.T
        return np.column_stack([0.5 * width + scale * seen[:, 0], 0.62 * height - scale * seen[:, 1]])

    edges = np.array([[-210, -200, 0], [210, -200, 0], [210, 110, 0], [-210, 110, 0]], float)
    drawing.polygon(flat(edges), "#eef1f4", PALE)
    parts: list[tuple[float, Callable[[], None]]] = []
    for centre, turn in zip(scene.blocks_mm, scene.turns, strict=True):
        drawing.circle(flat(centre[None] * (1, 1, 0))[0], 0.35 * EDGE_MM, "#dde2e7")
        parts.append((float(centre @ VIEW[2]), lambda c=centre, t=turn: _draw_block(drawing, flat, c, t)))
    for finger, ends in bones_of(SKELETON, scene.angles_deg):
        placed = ends @ DESK_FROM_HAND.T + scene.hand_mm
        parts.append(
            (
                float(placed.mean(axis=0) @ VIEW[2]),
                lambda e=placed, f=finger: _draw_bone(drawing, flat(e), f, scale),
            )
        )
    for _, draw in sorted(parts, key=lambda part: part[0]):
        draw()
    drawing.text((16, 26), words)
    return drawing


def _draw_block(
    drawing: Drawing, flat: Callable[[np.ndarray], np.ndarray], centre: np.ndarray, turn: np.ndarray
) -> None:
    corners = _CORNERS @ turn.T + centre
    for face in _FACES:
        sides = corners[list(face)]
        normal = sides.mean(axis=0) - centre
        if normal @ VIEW[2] > 0:
            light = 0.62 + 0.38 * max(0.0, float(normal @ (-0.25, -0.35, 0.9)) / (EDGE_MM / 2))
            red, green, blue = np.clip(WOOD * light, 0, 255).astype(int)
            drawing.polygon(flat(sides), f"#{red:02x}{green:02x}{blue:02x}")


def _draw_bone(drawing: Drawing, ends: np.ndarray, finger: str, scale: float) -> None:
    thick = THICKNESS_MM.get(finger, 22.0) * scale
    drawing.line(ends, EDGE, thick + 1.5)
    drawing.line(ends, COLOURS[finger], thick)
