"""One figure as SVG text; matplotlib without its global state of windows, so that any thread may draw."""

from __future__ import annotations

from collections.abc import Callable
from io import StringIO

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

MODEL, MEASURED, FLOOR, QUIET, DECOY = "#1d6cab", "#1a1a1a", "#d9822b", "#c9ced4", "#a3423f"
"""Colours: what the model says, what was measured, noise floors, what is only there for scale, decoys."""

mpl.rcParams["svg.fonttype"] = "none"  # text stays text: small files, and a reader can search them
mpl.rcParams["svg.hashsalt"] = "glovecal"
mpl.rcParams["font.size"] = 9


def svg(draw: Callable[[Axes], object], width: float, height: float) -> str:
    """What ``draw`` puts on one pair of axes of ``width`` x ``height`` inches."""
    return figure_svg(lambda figure: draw(figure.add_subplot()), width, height)


def figure_svg(draw: Callable[[Figure], object], width: float, height: float) -> str:
    """What ``draw`` puts into a figure."""
    figure = Figure(figsize=(width, height), layout="constrained")
    draw(figure)
    for axes in figure.axes:
        axes.spines[["top", "right"]].set_visible(False)
    stream = StringIO()
    figure.savefig(stream, format="svg", metadata={"Date": None})
    text = stream.getvalue()
    return text[text.index("<svg") :]
