"""One figure as SVG text; matplotlib without its global state of windows, so that any thread may draw.

Colours become the page's own variables, so that pictures follow its dark mode; the background is transparent.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from io import StringIO

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

MODEL, MEASURED, FLOOR, QUIET, CONTROL, CARD = (
    *("#1d6cab", "#1a1a1a", "#c26a12", "#b9c0c8", "#a3423f", "#f1f3f5"),
)
"""Colours: what the model says, what was measured (and all text), noise floors, what is only there for scale
or not significant, controls, empty cells."""
VARIABLES = {
    MODEL: "model", MEASURED: "ink", FLOOR: "floor", QUIET: "quiet", CONTROL: "control", CARD: "card",
}  # fmt: skip
SHARES = LinearSegmentedColormap.from_list("shares", [f"{MODEL}00", f"{MODEL}ff"])
"""From nothing to the model's colour: the page shows through where there is little."""
GREY_SHARES = LinearSegmentedColormap.from_list("grey shares", ["#80868c00", "#80868cff"])
"""The same for what is not significant."""

mpl.rcParams["svg.fonttype"] = "none"  # text stays text: small files, and a reader can search them
mpl.rcParams["svg.hashsalt"] = "glovecal"
mpl.rcParams["text.parse_math"] = False  # names of takes and columns may hold "$"
mpl.rcParams["font.size"] = 9
mpl.rcParams["legend.fontsize"] = 9
mpl.rcParams["legend.frameon"] = False
for _part in ("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color"):
    mpl.rcParams[_part] = MEASURED


def svg(draw: Callable[[Axes], object], width: float, height: float) -> str:
    """What ``draw`` puts on one pair of axes of ``width`` x ``height`` inches."""
    return figure_svg(lambda figure: draw(figure.add_subplot()), width, height)


def figure_svg(draw: Callable[[Figure], object], width: float, height: float) -> str:
    """What ``draw`` puts into a figure."""
    figure = Figure(figsize=(width, height), layout="constrained", facecolor="none")
    draw(figure)
    for axes in figure.axes:
        axes.spines[["top", "right"]].set_visible(False)
        axes.set_facecolor("none")
    stream = StringIO()
    figure.savefig(stream, format="svg", metadata={"Date": None}, transparent=True)
    text = stream.getvalue()
    return _with_own_ids(_with_variables(text[text.index("<svg") :]))


def legend_above(axes: Axes, columns: int = 3) -> None:
    """The legend over the axes, where it covers nothing."""
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=columns, borderaxespad=0.2)


def _with_variables(text: str) -> str:
    for colour, name in VARIABLES.items():
        text = text.replace(colour, f"var(--{name}, {colour})")
    return text


def _with_own_ids(text: str) -> str:
    """Only ids that are referred to stay, with a prefix of this picture: a page holds many pictures."""
    prefix = "p" + hashlib.sha256(text.encode()).hexdigest()[:8]
    used = set(re.findall(r'(?:url\(#|href="#)([^")]+)', text))
    text = re.sub(
        r' id="([^"]+)"', lambda found: f' id="{prefix}{found[1]}"' if found[1] in used else "", text
    )
    return re.sub(r'(url\(#|href="#)', rf"\g<1>{prefix}", text)
