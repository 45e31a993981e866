"""matplotlib, only when something is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from glovecal_models.installation import not_installed

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MODEL, CONTROL, FLOOR, SCALE = "#1d6cab", "#a3423f", "#d9822b", "#c9ced4"


def axes_for(ax: Axes | None, rows: int = 6) -> Axes:
    """``ax``, or the axes of a new figure with room for so many rows. Raises ImportError without
    matplotlib."""
    if ax is not None:
        return ax
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise ImportError(not_installed("plot()", "matplotlib")) from error
    _, new = pyplot.subplots(figsize=(7.0, 1.4 + 0.32 * rows), layout="constrained")
    return new


def named_rows(axes: Axes, names: Sequence[str]) -> None:
    """One row for each name, the first on top."""
    axes.set_yticks(range(len(names)), list(names))
    axes.set_ylim(len(names) - 0.4, -0.6)


def finished(axes: Axes) -> Axes:
    """With a legend above the picture, where it covers nothing; each label once."""
    handles = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    axes.legend(
        handles.values(), handles.keys(), frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4
    )
    axes.spines[["top", "right"]].set_visible(False)
    return axes
