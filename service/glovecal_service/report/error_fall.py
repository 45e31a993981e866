"""How the error falls: from no calibration over simpler ones through each effect down to the noise floor.

Bars from zero on a linear axis; a fall over decades is drawn as dots on a logarithmic one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.comparison.compare import RotationErrors
from glovecal_models.takes.take import Take
from glovecal_service.report.drawing import CONTROL, FLOOR, MODEL, QUIET, legend_above, svg
from glovecal_service.report.fall_steps import Fall, FloorBand, fall_sentence, lineage_falls

WIDE_RANGE = 15.0
"""From this ratio of the largest to the smallest error the axis is logarithmic."""


def error_fall(falls: Sequence[Fall], band: FloorBand | None) -> tuple[str, str]:
    """The picture, and what it shows."""
    errors = [item.rmse_deg for item in falls]
    smallest = min(errors) if band is None else min(*errors, band.low_deg)
    is_wide = max(errors) > WIDE_RANGE * max(smallest, 1e-9) and smallest > 0

    def draw(axes: Axes) -> None:
        places = np.arange(len(falls))
        if band is not None:
            axes.axhspan(
                band.low_deg, band.high_deg, color=FLOOR, alpha=0.35, label="noise floor, 95 % interval"
            )
            axes.axhline(band.floor_deg, color=FLOOR, linewidth=1)
        _draw_controls(axes, falls)
        colours = [QUIET if item.is_scale else MODEL for item in falls]
        axes.set_xticks(places, [item.label for item in falls])
        axes.set_ylabel("error (RMSE), degrees")
        if is_wide:
            axes.scatter(places, errors, s=70, color=colours, zorder=3)
            for place, error in zip(places, errors, strict=True):
                axes.annotate(_short(error), (place, error), (0, 8), textcoords="offset points", ha="center")
            axes.set(yscale="log", ylim=(0.6 * smallest, 2.0 * max(errors)), xlim=(-0.6, len(falls) - 0.4))
            axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=12))
            axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axes.yaxis.set_minor_formatter(NullFormatter())
        else:
            bars = axes.bar(places, errors, color=colours, width=0.62)
            axes.bar_label(bars, [_short(error) for error in errors], padding=3)
            axes.set_ylim(0, 1.12 * max([*errors, *(item.control_rmse_deg or 0.0 for item in falls)]))
        if axes.get_legend_handles_labels()[0]:
            legend_above(axes)

    return svg(draw, max(5.5, 1.5 + 1.25 * len(falls)), 3.6), fall_sentence(falls, band)


def _draw_controls(axes: Axes, falls: Sequence[Fall]) -> None:
    known = [(place, item.control_rmse_deg) for place, item in enumerate(falls) if item.control_rmse_deg]
    for number, (place, error) in enumerate(known):
        axes.hlines(
            error, place - 0.42, place + 0.42, color=CONTROL, linestyle="--", zorder=4,
            label="control in the effect's place" if number == 0 else "",
        )  # fmt: skip


def _short(error: float) -> str:
    return f"{error:.2f}" if error < 10 else f"{error:.1f}"


def lineage_fall(
    line: Sequence[CalibrationModel],
    scale: Mapping[str, CalibrationModel],
    takes: Sequence[Take],
    overall: RotationErrors,
) -> tuple[str, str]:
    """``line``: the versions, oldest first; ``scale``: simpler calibrations by name.

    ``overall`` are the newest one's errors. Raises LayoutMismatch, BadInput as residuals do.
    """
    floor = overall.floor
    band = None if floor is None else FloorBand(floor.floor_deg, floor.low_deg, floor.high_deg)
    return error_fall(lineage_falls(line, scale, takes), band)
