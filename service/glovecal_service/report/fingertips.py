"""Fingertips on a page: sentence, table, and both hands in the frame with the largest error."""

from __future__ import annotations

from typing import Any, Literal, get_args

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from glovecal_models.comparison.fingertips import FingertipErrors, TipErrors
from glovecal_models.comparison.text import fingertips_sentence
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.forward_kinematics import HandFrames, forward_kinematics
from glovecal_models.hand.rotations import PALM
from glovecal_models.hand.skeleton import Skeleton, hand_skeleton
from glovecal_service.report.drawing import FLOOR, MEASURED, MODEL, QUIET, figure_svg, legend_above
from glovecal_service.report.html import figure, paragraph, table

HEADS = ("fingertip", "RMSE", "noise floor", "95 % below", "error when predicting the mean", "frames")
SCALES = (
    "Distance in mm between the predicted and the measured fingertip, relative to the palm. Noise floors are "
    "those of the joints, propagated to the tip as if independent, with 95 % intervals. Thumb to index: the "
    "error of the distance between these two tips."
)
View = Literal["from the back", "from the thumb's side"]
_SEEN: dict[View, np.ndarray] = {
    "from the back": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0]]),
    "from the thumb's side": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
}
"""Each view's right and up, in the skeleton's frame; the fingers of a flat hand point up."""
SCALE_MM = 50.0
VIEWS: tuple[View, ...] = get_args(View)


def fingertips_part(errors: FingertipErrors | None, dimensions: HandDimensions | None) -> list[Markup]:
    """Nothing where the layout is no hand."""
    if errors is None:
        return []
    return [
        paragraph(fingertips_sentence(errors)),
        figure(*_picture(errors, dimensions)),
        _table(errors),
        paragraph(SCALES),
    ]


def _rows(errors: FingertipErrors) -> dict[str, TipErrors]:
    rows = {"all": errors.overall, **errors.fingers}
    return rows if errors.thumb_index is None else {**rows, "thumb to index": errors.thumb_index}


def _table(errors: FingertipErrors) -> Markup:
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
    skeleton = hand_skeleton(dimensions, palm="arching" if PALM in worst.measured_deg else "rigid")
    measured, predicted = (
        forward_kinematics(skeleton, np.array([list(angles.values())]))
        for angles in (worst.measured_deg, worst.predicted_deg)
    )

    def draw(page: Figure) -> None:
        bars, *hands = page.subplots(1, 1 + len(VIEWS), width_ratios=(1.5, 1, 1))
        _draw_bars(bars, errors)
        for axes, view in zip(hands, VIEWS, strict=True):
            _draw_hand(axes, skeleton, measured, 0, view, color=MEASURED, linewidth=1.2, label="measured")
            _draw_hand(axes, skeleton, predicted, 0, view, color=MODEL, linewidth=1.2, label="predicted")
            _draw_scale(axes, view)
        hands[0].legend(loc="upper center", bbox_to_anchor=(0.5, -0.02), ncols=2)

    sentence = (
        f"Right: the frame with the largest error, take {worst.take} at {worst.time_s:.1f} s: "
        f"{worst.finger} by {worst.error_mm:.1f} mm."
    )
    return figure_svg(draw, 9, 3.6), sentence


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
    axes.set_xlim(0, None)
    legend_above(axes, 2)


def _draw_hand(
    axes: Axes, skeleton: Skeleton, frames: HandFrames, frame: int, view: View, **style: Any
) -> None:
    """The bones of one frame, in mm."""
    label = style.pop("label", None)
    seen = _SEEN[view]
    for line in _lines(skeleton, frames, frame):
        right, up = seen @ line.T
        axes.plot(right, up, marker="o", markersize=2.5, label=label, solid_capstyle="round", **style)
        label = None
    axes.set_aspect("equal")
    axes.set_axis_off()


def _draw_scale(axes: Axes, view: View) -> None:
    """The view's name above, and a bar of ``SCALE_MM`` below the wrist."""
    axes.set_title(view)
    axes.plot([-SCALE_MM, 0.0], [-12.0, -12.0], color=QUIET, linewidth=3, solid_capstyle="butt")
    axes.text(-SCALE_MM / 2, -16.0, f"{SCALE_MM:.0f} mm", ha="center", va="top")


def _lines(skeleton: Skeleton, frames: HandFrames, frame: int) -> list[np.ndarray]:
    """Palm to tip of each finger, and across the knuckles; each (K, 3)."""
    fingers = []
    for tip, last in enumerate(skeleton.tip_joints):
        joints = frames.joints_mm[frame, list(skeleton.carrying(last))]
        fingers.append(np.vstack([joints, frames.tips_mm[frame, tip]]))
    names = [joint.name for joint in skeleton.joints]
    knuckles = frames.joints_mm[frame, [names.index(f"{finger}_MCP") for finger in "IMRP"]]
    return [*fingers, knuckles]
