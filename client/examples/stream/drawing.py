"""A drawing as a list of shapes: the live page draws it on its canvas, and it can be written as SVG."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

Points = Sequence[Sequence[float]] | np.ndarray
INK, PALE = "#1d2733", "#9aa7b4"


@dataclass
class Drawing:
    """Shapes in the order in which they are drawn; x to the right, y down, in units of the drawing."""

    width: float
    height: float
    shapes: list[dict[str, Any]] = field(default_factory=list)

    def line(self, points: Points, colour: str = INK, width: float = 2.0) -> None:
        self.shapes.append({"kind": "line", "points": _rounded(points), "colour": colour, "width": width})

    def polygon(self, points: Points, fill: str, edge: str = INK) -> None:
        self.shapes.append({"kind": "polygon", "points": _rounded(points), "colour": fill, "edge": edge})

    def circle(self, centre: Sequence[float] | np.ndarray, radius: float, fill: str) -> None:
        self.shapes.append(
            {"kind": "circle", "points": _rounded([centre]), "radius": round(radius, 2), "colour": fill}
        )

    def text(
        self, place: Sequence[float] | np.ndarray, words: str, size: float = 14, colour: str = INK,
        anchor: str = "start",
    ) -> None:  # fmt: skip
        """``anchor``: start, middle or end."""
        shape = {"kind": "text", "points": _rounded([place]), "words": words, "size": size}
        self.shapes.append(shape | {"colour": colour, "anchor": anchor})

    def add(self, other: Drawing, x: float, y: float) -> None:
        """All shapes of another drawing, moved."""
        for shape in other.shapes:
            moved = [[px + x, py + y] for px, py in shape["points"]]
            self.shapes.append(shape | {"points": _rounded(moved)})

    def document(self) -> dict[str, Any]:
        """For the live page, as JSON."""
        return {"width": self.width, "height": self.height, "shapes": self.shapes}

    def svg(self) -> str:
        box = f"0 0 {self.width:g} {self.height:g}"
        head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{box}" width="{self.width:g}" '
        head += f'height="{self.height:g}" font-family="sans-serif">'
        back = f'<rect width="{self.width:g}" height="{self.height:g}" fill="#ffffff"/>'
        return "\n".join([head, back, *(_element(shape) for shape in self.shapes), "</svg>", ""])


def _rounded(points: Iterable[Iterable[float]]) -> list[list[float]]:
    return [[round(float(value), 2) for value in point] for point in points]


def _element(shape: dict[str, Any]) -> str:
    (x, y), colour = shape["points"][0], shape["colour"]
    joined = " ".join(f"{px:g},{py:g}" for px, py in shape["points"])
    if shape["kind"] == "line":
        ends = f'stroke-width="{shape["width"]:g}" stroke-linecap="round" stroke-linejoin="round"'
        return f'<polyline points="{joined}" fill="none" stroke="{colour}" {ends}/>'
    if shape["kind"] == "polygon":
        return f'<polygon points="{joined}" fill="{colour}" stroke="{shape["edge"]}" stroke-width="0.8"/>'
    if shape["kind"] == "circle":
        return f'<circle cx="{x:g}" cy="{y:g}" r="{shape["radius"]:g}" fill="{colour}"/>'
    place = f'x="{x:g}" y="{y:g}" font-size="{shape["size"]:g}" text-anchor="{shape["anchor"]}"'
    return f'<text {place} fill="{colour}">{html.escape(shape["words"])}</text>'
