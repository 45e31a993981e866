"""Table 1 on the page."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from paper_page.parts import figure, svg, table
from paper_page.section import Section
from table_1 import Table1Row

from glovecal_models.presentation.drawing import FLOOR, MODEL, QUIET

HEADS = (
    *("kept still", "affecting", "std., paper", "std., ours", "95 % of ours"),
    *("max., paper", "max., ours", "named"),
)
SENTENCE = (
    "Standard deviation of the sensor whose rotation is kept still, per cent of its active range; on the "
    "line paper and ours agree. The simulated cloth was given the sizes of this table, so what is "
    "reproduced is the examination: it sees only readings. Far off the line is the palm with all nine "
    "neighbours moving: their pulls add up in the simulation, in the paper they do not."
)


def table_1_section(rows: Sequence[Table1Row]) -> Section:
    cells = [
        (
            row.rotation,
            row.affecting or "all at once",
            f"{row.paper_std_pct:.1f} %",
            f"{row.std_pct:.1f} %",
            "{:.1f} to {:.1f}".format(*row.interval_pct) if row.interval_pct else "-",
            f"{row.paper_max_pct:.1f} %",
            f"{row.max_pct:.1f} %",
            "yes" if row.is_named else "no",
        )
        for row in rows
    ]
    return Section((figure(_picture(rows), SENTENCE), table(HEADS, cells)))


def _picture(rows: Sequence[Table1Row]) -> str:
    def draw(axes: Axes) -> None:
        for name, colour, some in (
            ("one neighbour alone", MODEL, [row for row in rows if row.affecting]),
            ("all at once", FLOOR, [row for row in rows if not row.affecting]),
        ):
            theirs, ours = [row.paper_std_pct for row in some], [row.std_pct for row in some]
            axes.plot(theirs, ours, "o", color=colour, label=name)
        most = 1.1 * max(max(row.paper_std_pct, row.std_pct) for row in rows)
        axes.plot([0, most], [0, most], color=QUIET)
        axes.set(xlabel="paper, % of the range", ylabel="ours, % of the range")
        axes.set(xlim=(0, most), ylim=(0, most))
        axes.legend(frameon=False)

    return svg(draw, 5, 4)
