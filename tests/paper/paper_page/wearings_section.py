"""Multiple wearings on the page."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from multiple_wearings import WearingRow
from paper_page.parts import figure, svg, table
from paper_page.section import Section

from glovecal_models.presentation.drawing import FLOOR, MODEL

HEADS = ("wearing", "as it is", "after the quick check")
SENTENCE = (
    "Mean absolute error over the nine poses and 22 rotations by LMC-GPR of the first wearing, mean over "
    "subjects; the paper says that one training serves other wearings and gives no number. A quick check "
    "in which no pose was held steadily enough to be accepted is left out."
)


def wearings_section(rows: Sequence[WearingRow]) -> Section:
    wearings = list(dict.fromkeys(row.wearing for row in rows))
    as_it_is = [_mean([row.mean_deg for row in rows if row.wearing == each]) for each in wearings]
    checked = [_mean([row.checked_deg for row in rows if row.wearing == each]) for each in wearings]
    cells = [
        (
            "that of training" if not wearing else f"put on again, {wearing}",
            f"{before:.2f}°",
            "-" if np.isnan(after) else f"{after:.2f}°",
        )
        for wearing, before, after in zip(wearings, as_it_is, checked, strict=True)
    ]

    def draw(axes: Axes) -> None:
        axes.plot(wearings, as_it_is, "o-", color=MODEL, label="as it is")
        axes.plot(wearings, checked, "o-", color=FLOOR, label="after the quick check")
        axes.set(xlabel="wearing (0: that of training)", ylabel="mean |error|, degrees")
        axes.set_ylim(0, 1.3 * float(np.nanmax([*as_it_is, *checked])))
        axes.legend(frameon=False)

    return Section((figure(svg(draw, 6, 3.2), SENTENCE), table(HEADS, cells)))


def _mean(values: Sequence[float | None]) -> float:
    """NaN where there is none."""
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else float("nan")
