"""The part of a page about fingertips: sentence, table, and the hand where it is farthest off."""

from __future__ import annotations

from html import escape
from typing import get_args

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from glovecal_models.comparison.fingertips import FingertipErrors, TipErrors
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_service.report.drawing import FLOOR, MEASURED, MODEL, figure_svg
from glovecal_service.report.hand_drawing import View, draw_hand, draw_scale
from glovecal_service.report.html import figure, table

HEADS = ("fingertip", "RMSE", "noise floor", "95 % below", "its own spread", "frames")
SCALES = (
    "Millimetres between the predicted and the measured fingertip, seen from the palm. Noise floors are "
    "those of the joints, carried to the tip as if independent, with the ends of their 95 % intervals. Its "
    "own spread: the error of always answering the mean angles. Thumb to index: how wrong the distance "
    "between these two tips is."
)
VIEWS: tuple[View, ...] = get_args(View)


def fingertips_part(errors: FingertipErrors | None, dimensions: HandDimensions | None) -> list[str]:
    """HTML; nothing where the layout is no hand."""
    if errors is None:
        return []
    return [
        "<h2>How far off the fingertips are</h2>",
        f"<p>{escape(errors.sentence)}</p>",
        figure(*_picture(errors, dimensions)),
        _table(errors),
        f"<p>{escape(SCALES)}</p>",
    ]


def _rows(errors: FingertipErrors) -> dict[str, TipErrors]:
    rows = {"all": errors.over_all, **errors.fingers}
    return rows if errors.thumb_index is None else {**rows, "thumb to index": errors.thumb_index}


def _table(errors: FingertipErrors) -> str:
    rows = [
        (
            name, f"{one.rmse_mm:.2f}", _floor(one), f"{one.percentile_95_mm:.2f}", f"{one.baseline_mm:.1f}",
            str(one.count),
        )
        for name, one in _rows(errors).items()
    ]  # fmt: skip
    return table(HEADS, rows)


def _floor(one: TipErrors) -> str:
    if one.floor is None:
        return "unknown"
    least = "at least " if one.floor.is_lower_bound else ""
    return f"{least}{one.floor.floor_mm:.2f} ({one.floor.low_mm:.2f}-{one.floor.high_mm:.2f})"


def _picture(errors: FingertipErrors, dimensions: HandDimensions | None) -> tuple[str, str]:
    """Errors against their floors; beside them both hands in the worst frame."""
    worst = errors.worst
    skeleton = hand_skeleton(dimensions)
    measured, predicted = (
        forward_kinematics(skeleton, np.array([list(angles.values())]))
        for angles in (worst.measured_deg, worst.predicted_deg)
    )

    def draw(page: Figure) -> None:
        bars, *hands = page.subplots(1, 1 + len(VIEWS), width_ratios=(1.5, 1, 1))
        _draw_bars(bars, errors)
        for axes, view in zip(hands, VIEWS, strict=True):
            draw_hand(axes, skeleton, measured, 0, view, color=MEASURED, linewidth=1.2, label="measured")
            draw_hand(axes, skeleton, predicted, 0, view, color=MODEL, linewidth=1.2, label="predicted")
            draw_scale(axes, view)
        hands[0].legend(frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.02), ncols=2)

    sentence = (
        f"Right: the frame in which a fingertip is farthest off, take {worst.take} at {worst.time_s:.1f} s: "
        f"the {worst.finger} by {worst.error_mm:.1f} mm."
    )
    return figure_svg(draw, 9, 3.4), sentence


def _draw_bars(axes: Axes, errors: FingertipErrors) -> None:
    items = list(_rows(errors).items())[::-1]
    rows = np.arange(len(items))
    axes.barh(rows, [one.rmse_mm for _, one in items], color=MODEL, label="error (RMSE)")
    known = [(row, one.floor) for row, (_, one) in zip(rows, items, strict=True) if one.floor is not None]
    for number, (row, floor) in enumerate(known):
        label = "noise floor" if number == 0 else None
        axes.plot([floor.low_mm, floor.high_mm], [row, row], color=FLOOR, linewidth=2)
        axes.plot(floor.floor_mm, row, "|", color=FLOOR, markersize=11, markeredgewidth=3, label=label)
    axes.set_yticks(rows, [name for name, _ in items])
    axes.set_xlabel("mm")
    axes.legend(frameon=False, loc="lower left", bbox_to_anchor=(0, 1), ncols=2)
