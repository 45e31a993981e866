"""Charts as SVG text and for paper; matplotlib without its global state of windows, for any thread.

In SVG colours become the page's own variables, so that pictures follow its dark mode; the background is
transparent.
"""

from __future__ import annotations

import hashlib
import re
from io import BytesIO
from threading import Lock
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from glovecal_models.installation import not_installed
from glovecal_models.presentation.document import Chart

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap

MODEL, MEASURED, FLOOR, QUIET, CONTROL, CARD = (
    *("#1d6cab", "#1a1a1a", "#c26a12", "#b9c0c8", "#a3423f", "#f1f3f5"),
)
"""Colours: what the model says, what was measured (and all text), noise floors, what is only there for scale
or not significant, controls, empty cells."""
GREY = "#80868c"
SEVERAL = ("#1d6cab", "#3f9c6b", "#8d5fa8", "#c2453d", "#6b6b6b", "#17a2a8", "#a8790f", "#d16ba5")
"""Colours of things of one kind, such as models."""
TICK_LETTERS = 34
"""Of a tick, in one line."""
HEAT = "Blue with a dot: significant; grey: not."
"""What ``draw_heat`` draws."""
VARIABLES = {
    MODEL: "model", MEASURED: "ink", FLOOR: "floor", QUIET: "quiet", CONTROL: "control", CARD: "card",
}  # fmt: skip
STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",  # text stays text: small files, and a reader can search them
    "svg.hashsalt": "glovecal",
    "text.parse_math": False,  # names of takes and columns may hold "$"
    "font.size": 9,
    "legend.fontsize": 9,
    "legend.frameon": False,
    **dict.fromkeys(
        ("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color"), MEASURED
    ),
}
SAVED: dict[Any, dict[str, Any]] = {
    "svg": {"metadata": {"Date": None}, "transparent": True},
    "png": {"dpi": 200, "facecolor": "white", "bbox_inches": "tight", "pad_inches": 0.04},
}
"""Names that are too long for the figure make a printed picture larger; it is fitted to the paper."""


_DRAWING = Lock()


def shares(colour: str = MODEL) -> Colormap:
    """From nothing to a colour: the page shows through where there is little."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("shares", [f"{colour}00", f"{colour}ff"])


def svg(chart: Chart) -> str:
    """The picture of a chart, to be put into a page; "" without matplotlib."""
    text = _picture(chart, "svg").decode()
    return _with_own_ids(_with_variables(text[text.index("<svg") :])) if text else ""


def png(chart: Chart) -> bytes:
    """The picture of a chart, to be printed. Without matplotlib there is none: b""."""
    return _picture(chart, "png")


def _picture(chart: Chart, form: Literal["svg", "png"]) -> bytes:
    try:
        from matplotlib import rc_context
        from matplotlib.figure import Figure
    except ImportError:
        return b""
    with _DRAWING, rc_context(STYLE):  # the settings are of the whole process
        figure = Figure(figsize=(chart.width, chart.height), layout="constrained", facecolor="none")
        if chart.panels is not None:
            chart.panels(figure)
        elif chart.draw is not None:
            chart.draw(figure.add_subplot())
        for axes in figure.axes:
            axes.spines[["top", "right"]].set_visible(False)
            axes.set_facecolor("none")
            _wrap_names(axes)
        stream = BytesIO()
        figure.savefig(stream, format=form, **SAVED[form])
    return stream.getvalue()


def _wrap_names(axes: Axes) -> None:
    """Names that would leave the picture no room stand in small letters on several lines."""
    for axis in (axes.xaxis, axes.yaxis):
        ticks = axis.get_ticklabels()
        names = [tick.get_text() for tick in ticks]
        if any(len(name) > TICK_LETTERS for name in names):
            axis.set_ticklabels([_in_lines(name) for name in names])
            for tick, name in zip(ticks, names, strict=True):
                if len(name) > TICK_LETTERS:
                    tick.set_fontsize(6)


def _in_lines(name: str) -> str:
    return "\n".join(name[at : at + TICK_LETTERS] for at in range(0, len(name), TICK_LETTERS))


def plotted(chart: Chart, axes: Axes | None) -> Axes:
    """The chart on ``axes``, or on those of a new window. Raises ImportError without matplotlib."""
    if axes is None:
        try:
            from matplotlib import pyplot
        except ImportError as error:
            raise ImportError(not_installed("plot()", "matplotlib")) from error
        _, axes = pyplot.subplots(figsize=(chart.width, chart.height), layout="constrained")
    assert chart.draw is not None
    chart.draw(axes)
    axes.spines[["top", "right"]].set_visible(False)
    return axes


def legend_above(axes: Axes, columns: int = 3) -> None:
    """The legend over the axes, where it covers nothing."""
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=columns, borderaxespad=0.2)


def draw_heat(axes: Axes, values: np.ndarray, significant: np.ndarray, highest: float, label: str) -> None:
    """Cells (R, C) from 0 to ``highest``, NaN for none: blue with a dot where significant, else grey."""
    drawn = {"aspect": "auto", "vmin": 0, "vmax": highest, "interpolation": "none"}
    axes.imshow(np.where(significant, np.nan, values), cmap=shares(GREY), **drawn)
    image = axes.imshow(np.where(significant, values, np.nan), cmap=shares(), **drawn)
    rows, columns = np.nonzero(significant)
    axes.plot(columns, rows, ".", color=FLOOR, markersize=6)
    axes.figure.colorbar(image, ax=axes, label=label, shrink=0.8)


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
