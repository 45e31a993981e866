"""One page to print, drawn in mm from its upper left corner, x to the right, y down; as SVG and PDF.

Drawn with matplotlib: one library for both formats, and the service brings it already.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_pdf import FigureCanvasPdf, PdfPages
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Curve

from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean

MM_OF_INCH = 25.4
POINTS_OF_MM = 72 / MM_OF_INCH
PAPERS_MM = {"a4": (210.0, 297.0), "letter": (215.9, 279.4)}
"""Width and height of a page held upright."""
MARGIN_MM = 10.0
"""Printers reach all but this."""
SCALE_BAR_MM = 100.0
GREY = "0.45"
_SETTINGS: dict[Any, Any] = {
    "svg.hashsalt": "glovecal",
    "svg.fonttype": "path",
    "pdf.fonttype": 3,
    "font.family": "DejaVu Sans",
}


@dataclass(frozen=True)
class Box:
    """A part of a page, mm."""

    left: float
    top: float
    right: float
    bottom: float


class Sheet:
    """A page, with its title at the top and a scale bar at the bottom. Raises BadInput for another paper."""

    def __init__(self, paper: str, title: str, *, landscape: bool = False) -> None:
        if paper not in PAPERS_MM:
            raise BadInput(f"paper {paper!r}; {did_you_mean(paper, PAPERS_MM)}")
        short, long = PAPERS_MM[paper]
        self.width_mm, self.height_mm = (long, short) if landscape else (short, long)
        self.title = title
        self._figure = Figure(figsize=(self.width_mm / MM_OF_INCH, self.height_mm / MM_OF_INCH))
        self._axes = self._figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self._axes.set_axis_off()
        self._axes.set(xlim=(0, self.width_mm), ylim=(self.height_mm, 0))
        self.text((MARGIN_MM, MARGIN_MM), title, size_mm=3.6, bold=True, anchor="left top")
        self._scale_bar()

    @property
    def room(self) -> Box:
        """What title and scale bar leave."""
        right, bottom = self.width_mm - MARGIN_MM, self.height_mm - MARGIN_MM
        return Box(MARGIN_MM, MARGIN_MM + 7.0, right, bottom - 9.0)

    def shape(
        self,
        loops: Sequence[np.ndarray],
        *,
        fill: str | tuple[float, ...] | None = None,
        line: str | tuple[float, ...] | None = None,
        width_mm: float = 0.25,
        dashed: bool = False,
        within: Box | None = None,
        layer: int = 2,
    ) -> None:
        """Closed loops, each (N, 2); one that runs the other way around inside another is a hole."""
        points = np.concatenate([np.vstack([loop, loop[:1]]) for loop in loops])
        codes = [
            code
            for loop in loops
            for code in (Curve.MOVETO, *[Curve.LINETO] * (len(loop) - 1), Curve.CLOSEPOLY)
        ]
        patch = PathPatch(
            Curve(points, codes),
            facecolor=fill or "none",
            edgecolor=line or "none",
            linewidth=width_mm * POINTS_OF_MM if line else 0.0,
            linestyle=(0, (5, 3)) if dashed else "solid",
            joinstyle="round",
            zorder=layer,
        )
        self._axes.add_artist(patch)
        self._clip(patch, within)

    def box(self, box: Box, **style: object) -> None:
        corners = [(box.left, box.top), (box.right, box.top), (box.right, box.bottom), (box.left, box.bottom)]
        self.shape([np.array(corners)], **style)  # type: ignore[arg-type]

    def line(
        self, points: np.ndarray, *, width_mm: float = 0.25, colour: str = "black", dashed: bool = False
    ) -> None:
        x, y = np.asarray(points, dtype=float).T
        style = (0, (5, 3)) if dashed else "solid"
        self._axes.plot(
            x, y, color=colour, linewidth=width_mm * POINTS_OF_MM, linestyle=style, zorder=5, scalex=False,
            scaley=False, solid_capstyle="butt",
        )  # fmt: skip

    def cross(self, place: tuple[float, float], name: str = "") -> None:
        """A registration mark: lay one over the other."""
        x, y = place
        for dx, dy in ((4.0, 0.0), (0.0, 4.0)):
            self.line(np.array([(x - dx, y - dy), (x + dx, y + dy)]), width_mm=0.2)
        around = np.linspace(0, 2 * np.pi, 40)
        self.line(np.column_stack([x + 2 * np.cos(around), y + 2 * np.sin(around)]), width_mm=0.2)
        self.text((x + 2.5, y - 1.0), name, size_mm=2.4)

    def text(
        self,
        place: tuple[float, float],
        words: str,
        *,
        size_mm: float = 3.0,
        bold: bool = False,
        anchor: str = "left bottom",
        colour: str = "black",
        turned_deg: float = 0.0,
    ) -> None:
        """``anchor``: left, center or right, then top, center or bottom. ``size_mm``: of the font."""
        across, up = anchor.split()
        self._axes.text(
            *place, words, fontsize=size_mm * POINTS_OF_MM, weight="bold" if bold else "normal", ha=across,
            va=up, color=colour, rotation=turned_deg, zorder=6, linespacing=1.35, parse_math=False,
        )  # fmt: skip

    def _scale_bar(self) -> None:
        left, y = MARGIN_MM, self.height_mm - MARGIN_MM
        for tick in range(11):
            x, high = left + tick * SCALE_BAR_MM / 10, 4.0 if tick % 5 == 0 else 2.0
            self.line(np.array([(x, y), (x, y - high)]), width_mm=0.2)
        self.line(np.array([(left, y), (left + SCALE_BAR_MM, y)]), width_mm=0.3)
        said = "100 mm if printed\nat 100 %: measure"
        self.text((left + SCALE_BAR_MM + 3.0, y), said, size_mm=2.6)

    def _clip(self, patch: PathPatch, within: Box | None) -> None:
        if within is not None:
            left, top, right, bottom = within.left, within.top, within.right, within.bottom
            corners = [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)]
            patch.set_clip_path(Curve(np.array(corners)), self._axes.transData)

    @property
    def figure(self) -> Figure:
        return self._figure


def write_sheets(folder: Path, name: str, sheets: Sequence[Sheet]) -> list[Path]:
    """``name``.pdf with all pages, and a page each as ``name``.svg or ``name``-1.svg and so on."""
    folder.mkdir(parents=True, exist_ok=True)
    written = [folder / f"{name}.pdf"]
    with mpl.rc_context(_SETTINGS):
        with PdfPages(written[0], metadata={"CreationDate": None, "Title": sheets[0].title}) as pages:
            for sheet in sheets:
                FigureCanvasPdf(sheet.figure)
                pages.savefig(sheet.figure)
        for number, sheet in enumerate(sheets, 1):
            written.append(folder / (f"{name}-{number}.svg" if len(sheets) > 1 else f"{name}.svg"))
            FigureCanvasSVG(sheet.figure).print_svg(str(written[-1]), metadata={"Date": None})
    return written
