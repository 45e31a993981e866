"""Table 3 on the page."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from paper_page.calibrations import CALIBRATION_NAMES, COLOURS
from paper_page.parts import figure, figure_svg, table
from paper_page.section import Demand, Section
from table_3 import Table3Row

from glovecal_models.presentation.drawing import MEASURED

HEADS = ("pose", "calibration", "paper", "ours", "same wearing", "the wearing alone", "must reach")
TICKS_DEG = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
NOTE = (
    "Absolute error over 22 rotations, degrees, mean ± standard deviation, in wearings and motions that "
    "training has not seen. Same wearing: the mean in the wearing of training. The wearing alone: the mean "
    "by which putting the glove on again moves the angles, which no calibration of another wearing can "
    "avoid. LMC-GPR and SPGP must be at or below the paper's mean."
)


def table_3_section(rows: Sequence[Table3Row]) -> Section:
    subjects = len(rows) // len({(row.pose, row.calibration) for row in rows})
    found = pooled(rows)
    demands = {
        (row.pose, row.calibration): Demand(
            f"{row.pose}, {CALIBRATION_NAMES[row.calibration]}", row.mean_deg, row.paper_mean_deg, "degrees"
        )
        for row in found
        if row.calibration in ("lmc_gpr", "spgp")
    }
    cells = [
        (
            row.pose,
            CALIBRATION_NAMES[row.calibration],
            f"{row.paper_mean_deg:.1f}° ± {row.paper_sd_deg:.1f}°",
            f"{row.mean_deg:.1f}° ± {row.sd_deg:.1f}°",
            f"{row.same_wearing_deg:.1f}°",
            f"{row.wearing_deg:.1f}°",
            demands[row.pose, row.calibration].mark() if (row.pose, row.calibration) in demands else "-",
        )
        for row in found
    ]
    picture = figure(_picture(found), _sentence(found, subjects))
    return Section((picture, table(HEADS, cells), f"<p>{NOTE}</p>"), tuple(demands.values()))


def pooled(rows: Sequence[Table3Row]) -> list[Table3Row]:
    """Over subjects, who have equally many errors each."""
    together = []
    for pose, calibration in dict.fromkeys((row.pose, row.calibration) for row in rows):
        own = [row for row in rows if (row.pose, row.calibration) == (pose, calibration)]
        mean = float(np.mean([row.mean_deg for row in own]))
        square = float(np.mean([row.sd_deg**2 + row.mean_deg**2 for row in own]))
        together.append(
            Table3Row(
                pose,
                own[0].calibration,
                own[0].paper_mean_deg,
                own[0].paper_sd_deg,
                mean,
                float(np.sqrt(square - mean**2)),
                float(np.mean([row.same_wearing_deg for row in own])),
                float(np.mean([row.wearing_deg for row in own])),
            )
        )
    return together


def _sentence(rows: Sequence[Table3Row], subjects: int) -> str:
    told = []
    for calibration in ("raw", "linear"):
        own = [row for row in rows if row.calibration == calibration]
        ours, paper = [row.mean_deg for row in own], [row.paper_mean_deg for row in own]
        told.append(
            f"{calibration} {min(ours):.1f} to {max(ours):.1f} degrees (paper: {min(paper):.1f} to "
            f"{max(paper):.1f})"
        )
    people = f"{subjects} simulated subjects" if subjects > 1 else "one simulated subject"
    return f"Mean errors of {people}; black: the paper's. How hard the glove is: {' and '.join(told)}."


def _picture(rows: Sequence[Table3Row]) -> str:
    poses = list(dict.fromkeys(row.pose for row in rows))

    def draw(figure: Figure) -> None:
        axes = figure.add_subplot()
        for place, (calibration, name) in enumerate(CALIBRATION_NAMES.items()):
            own = [row for row in rows if row.calibration == calibration]
            at = np.arange(len(poses)) + 0.2 * (place - 1.5)
            axes.bar(at, [row.mean_deg for row in own], 0.18, color=COLOURS[calibration], label=name)
            paper = [row.paper_mean_deg for row in own]
            axes.hlines(paper, at - 0.09, at + 0.09, color=MEASURED, label="" if place else "paper")
        axes.set_xticks(range(len(poses)), poses)
        axes.set_yscale("log")
        axes.set_yticks(TICKS_DEG, [f"{tick:g}" for tick in TICKS_DEG])
        axes.minorticks_off()
        axes.set_ylabel("mean |error|, degrees")
        axes.legend(frameon=False, ncols=5, loc="lower left", bbox_to_anchor=(0, 1))

    return figure_svg(draw, 9.5, 3.6)
