"""The figure as a drawing: of one moment, or a strip of many."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from stream.drawing import INK, PALE, Drawing

from walking.figure import Leg

TRUNK_MM, HEAD_MM, ARM_MM = 520.0, 110.0, 300.0
NEAR, FAR = "#c65f3a", "#3b76b8"
GROUND_MM, TOP_MM = -160.0, 1800.0


def figure_drawing(
    legs: tuple[Leg, Leg], width: float = 960, height: float = 420, *, words: str = ""
) -> Drawing:
    """The figure in the middle, over a ground with a mark every half metre."""
    drawing = Drawing(width, height)
    centre = legs[0].hip_mm[0]
    scale = height / (TOP_MM - GROUND_MM)
    place = _Place(scale, width / 2 - centre * scale, height + GROUND_MM * scale)
    reach = width / 2 / scale
    _draw_ground(drawing, place, centre - reach, centre + reach)
    draw_figure(drawing, place, legs)
    drawing.text((16, 24), words)
    return drawing


def strip(moments: Sequence[tuple[Leg, Leg]], title: str, height: float = 400) -> Drawing:
    """Figures where they walked, one moment after another over the same ground; planted feet are dots."""
    places = [legs[0].hip_mm[0] for legs in moments]
    first, last = min(places) - 500.0, max(places) + 500.0
    scale = (height - 30) / (TOP_MM - GROUND_MM)
    width = max((last - first) * scale, 600.0)
    drawing = Drawing(width, height)
    place = _Place(scale, -first * scale, height + GROUND_MM * scale)
    _draw_ground(drawing, place, first, first + width / scale)
    for legs in moments:
        draw_figure(drawing, place, legs)
    drawing.text((10, 18), title, 13)
    return drawing


class _Place:
    """From mm in the world to the drawing."""

    def __init__(self, scale: float, x: float, y: float) -> None:
        self.scale, self._x, self._y = scale, x, y

    def __call__(self, *points_mm: np.ndarray | tuple[float, float]) -> np.ndarray:
        points = np.array(points_mm, dtype=float)
        return np.column_stack([self._x + self.scale * points[:, 0], self._y - self.scale * points[:, 1]])


def draw_figure(drawing: Drawing, place: _Place, legs: tuple[Leg, Leg]) -> None:
    hip = legs[0].hip_mm
    neck = _moved(hip, 30.0, TRUNK_MM)
    thick = 60 * place.scale
    for leg, colour, other in ((legs[1], FAR, legs[0]), (legs[0], NEAR, legs[1])):
        if colour == NEAR:
            drawing.line(place(hip, neck), INK, thick * 1.3)
        drawing.line(place(hip, leg.knee_mm, leg.foot_mm, _moved(leg.foot_mm, 110.0, 0.0)), colour, thick)
        swing = 0.6 * float(other.foot_mm[0] - hip[0])
        shoulder = _moved(neck, 0.0, -40.0)
        elbow = _moved(shoulder, 0.4 * swing - 30.0, -ARM_MM * 0.9)
        fingers = _moved(elbow, 0.6 * swing + 90.0, -ARM_MM * 0.7)
        drawing.line(place(shoulder, elbow, fingers), colour, thick * 0.7)
        if leg.planted:
            drawing.circle(place(_moved(leg.foot_mm, 0.0, -70.0))[0], 22 * place.scale, INK)
    drawing.circle(place(_moved(neck, 20.0, HEAD_MM + 50.0))[0], HEAD_MM * place.scale, INK)


def _moved(place_mm: np.ndarray, forward_mm: float, up_mm: float) -> np.ndarray:
    return place_mm + np.array([forward_mm, up_mm])


def _draw_ground(drawing: Drawing, place: _Place, begin_mm: float, end_mm: float) -> None:
    drawing.line(place((begin_mm, -35.0), (end_mm, -35.0)), PALE, 1.5)
    for mark in range(int(begin_mm // 500), int(end_mm // 500) + 1):
        (x, y), (_, low) = place((mark * 500.0, -35.0), (mark * 500.0, -75.0))
        drawing.line([(x, y), (x, low)], PALE, 1.5)
        drawing.text((x + 3, low + 9), f"{mark / 2:g} m", 10, PALE)
