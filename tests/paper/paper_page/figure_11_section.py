"""Figure 11 on the page."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from figure_11 import Figure11Row
from matplotlib.figure import Figure
from paper_page.calibrations import CALIBRATION_NAMES, COLOURS
from paper_page.parts import figure, figure_svg, table
from paper_page.section import Demand, Section
from paper_subject import Curve

from glovecal_models.presentation.drawing import MEASURED

HEADS = ("held at", "wearing", "calibration", "|bias|", "sd", "sd offline", "must reach: bias", "sd")
NOTE = (
    "Mean over subjects, degrees, frame by frame. The paper draws curves without numbers and says that raw "
    "and linear are unstable and that at 25 degrees, which no widget of training has, the prediction is "
    "slightly too small. sd offline: of the same angles cleaned over half a second, what the "
    "calibration itself leaves."
)
SENTENCE = (
    "IM_ABD of the first subject in another wearing, while the fingers bend freely; black: where the widget "
    "holds it."
)
MOST_DEG = 1.0


def figure_11_section(rows: Sequence[Figure11Row], curves: Sequence[Curve]) -> Section:
    cells, demands = [], []
    for fixed, wearing, calibration in dict.fromkeys(
        (row.fixed_deg, row.wearing, row.calibration) for row in rows
    ):
        own = [
            row
            for row in rows
            if (row.fixed_deg, row.wearing, row.calibration) == (fixed, wearing, calibration)
        ]
        worn, name = "other" if wearing else "same", CALIBRATION_NAMES[calibration]
        bias = float(np.mean([abs(row.bias_deg) for row in own]))
        sd = float(np.mean([row.sd_deg for row in own]))
        marks = ["-", "-"]
        if calibration == "lmc_gpr":
            what = f"gap held at {fixed:g} degrees, {worn} wearing, {name}"
            judged = (
                Demand(f"{what}: bias", bias, MOST_DEG, "degrees"),
                Demand(f"{what}: sd", sd, MOST_DEG, "degrees"),
            )
            marks = [demand.mark() for demand in judged]
            demands += judged
        offline = float(np.mean([row.offline_sd_deg for row in own]))
        cells.append((f"{fixed:g}°", worn, name, f"{bias:.2f}°", f"{sd:.2f}°", f"{offline:.2f}°", *marks))
    first = [curve for curve in curves if curve.seed == curves[0].seed]
    picture = figure(_picture(first), SENTENCE)
    return Section((picture, table(HEADS, cells), f"<p>{NOTE}</p>"), tuple(demands))


def _picture(curves: Sequence[Curve]) -> str:
    angles = list(dict.fromkeys(curve.fixed_deg for curve in curves))

    def draw(figure: Figure) -> None:
        every = figure.subplots(1, len(angles), sharey=True, squeeze=False)[0]
        for axes, fixed in zip(every, angles, strict=True):
            for curve in curves:
                if curve.fixed_deg == fixed:
                    time_s = np.arange(len(curve.angles_deg)) / curve.rate_hz
                    axes.plot(
                        time_s,
                        curve.angles_deg,
                        color=COLOURS[curve.calibration],
                        label=CALIBRATION_NAMES[curve.calibration],
                        linewidth=1.1,
                        linestyle="--" if curve.calibration == "spgp" else "-",
                    )
            axes.axhline(fixed, color=MEASURED, linewidth=0.9)
            axes.set(title=f"held at {fixed:g} degrees", xlabel="seconds")
        every[0].set_ylabel("calibrated IM_ABD, degrees")
        every[0].legend(frameon=False, fontsize=8)

    return figure_svg(draw, 9.5, 3.6)
