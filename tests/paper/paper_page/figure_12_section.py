"""Figure 12 on the page."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from figure_12 import Figure12Row
from matplotlib.figure import Figure
from paper_page.beside import number
from paper_page.calibrations import CALIBRATION_NAMES, COLOURS
from paper_page.parts import figure, figure_svg, table
from paper_page.section import Demand, Section

from glovecal_models.hand.rotations import FINGERS
from glovecal_models.presentation.drawing import MEASURED

HEADS = ("thumb and", "wearing", "calibration", "paper", "ours", "ours, offline", "must reach")
AT_MOST_CM = {"lmc_gpr": 0.1, "spgp": 0.5}
NOTE = (
    "Mean distance of the tips in 176 frames of a touching motion that was not among the samples; the ideal "
    "is 0. The paper gives numbers for thumb and index finger alone, and does not say whether that motion "
    "was among its samples. Offline: the same angles cleaned over half a second; what must be reached is "
    "judged frame by frame, where the noise of ten sensors alone puts tips about 0.25 cm apart."
)
TICKS_CM = (0.03, 0.1, 0.3, 1.0, 3.0, 10.0)
SENTENCE = "Quartiles of the distance in the wearing of training, first subject; black: the paper's means."


def figure_12_section(rows: Sequence[Figure12Row]) -> Section:
    cells, demands = [], []
    for finger, wearing, calibration in dict.fromkeys(
        (row.finger, row.wearing, row.calibration) for row in rows
    ):
        own = [
            row
            for row in rows
            if (row.finger, row.wearing, row.calibration) == (finger, wearing, calibration)
        ]
        worn, name = "other" if wearing else "same", CALIBRATION_NAMES[calibration]
        mean = float(np.mean([row.mean_cm for row in own]))
        offline = float(np.mean([row.offline_cm for row in own]))
        mark = "-"
        if calibration in AT_MOST_CM:
            what = f"thumb and {FINGERS[finger]} touching, {worn} wearing, {name}"
            demands.append(Demand(what, mean, AT_MOST_CM[calibration], "cm"))
            mark = demands[-1].mark()
        paper = f"{number(own[0].paper_cm, '.2f')} cm" if own[0].paper_cm is not None else "-"
        cells.append((FINGERS[finger], worn, name, paper, f"{mean:.2f} cm", f"{offline:.2f} cm", mark))
    picture = figure(_picture(rows), SENTENCE)
    return Section((picture, table(HEADS, cells), f"<p>{NOTE}</p>"), tuple(demands))


def _picture(rows: Sequence[Figure12Row]) -> str:
    first = [row for row in rows if row.seed == rows[0].seed and not row.wearing]
    fingers = list(dict.fromkeys(row.finger for row in first))

    def draw(figure: Figure) -> None:
        every = figure.subplots(1, len(fingers), sharey=True, squeeze=False)[0]
        for axes, finger in zip(every, fingers, strict=True):
            own = [row for row in first if row.finger == finger]
            for place, row in enumerate(own):
                if row.paper_cm is not None:
                    axes.hlines(row.paper_cm, place - 0.4, place + 0.4, color=MEASURED)
                low, middle, high = row.quartiles_cm
                axes.bar(place, high - low, 0.6, bottom=low, color=COLOURS[row.calibration])
                axes.hlines(middle, place - 0.3, place + 0.3, color="white")
            axes.set_xticks(range(len(CALIBRATION_NAMES)), list(CALIBRATION_NAMES.values()), rotation=40)
            axes.set_title(f"thumb and {FINGERS[finger]}")
            axes.set_yscale("log")
            axes.set_yticks(TICKS_CM, [f"{tick:g}" for tick in TICKS_CM])
            axes.minorticks_off()
            axes.set_ylim(min(0.05, min(row.quartiles_cm[0] for row in first)), 12)
        every[0].set_ylabel("distance of the tips, cm")

    return figure_svg(draw, 9.5, 3.6)
