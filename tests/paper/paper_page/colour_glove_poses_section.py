"""From photograph to pose on the page: errors by stage, Figures 11 and 12, times."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from colour_glove_chain import ChainRow, DepthRow
from colour_glove_motion import MotionRow
from colour_glove_scene import HANDS
from matplotlib.figure import Figure
from paper_page.parts import figure, figure_svg, table
from paper_page.section import Demand

from glovecal_models.presentation.drawing import FLOOR, MODEL, QUIET

MUST = {
    (1, HANDS[0], "ik"): 7.0,
    (1, HANDS[0], "dense"): 6.0,
    (1, HANDS[1], "ik"): 9.0,
    (1, HANDS[1], "dense"): 8.0,
}
"""Mean absolute joint error, degrees."""
MOST_RMS_DEG, LEAST_ACCEPTED, COVERAGE, MOST_CHAIN_MS = 5.0, 0.4, (0.90, 0.98), 15.0
PAPER_DEPTH_MM = (50, 100)
PAPER_MS = "50 + 20 + 30, told as 150"
CHAIN_HEADS = (
    *("cameras", "hand", "stage", "joints: mean error, degrees", "must reach", "orientation, degrees"),
    *("depth, mm", "aside, mm", "reprojection, px", "joints inside the 95 % interval"),
    *("accepted", "RMS of accepted, degrees", "inside", "classifier, ms", "pose, ms"),
)
MOTION_HEADS = (
    *("sequence", "hand", "method", "joints: mean error, degrees", "depth: mean error, mm"),
    *("reprojection, px", "jitter of joints, degrees", "true", "jitter of depth, mm", "true"),
)
NOTE = (
    "Photographs are <b>drawn</b>: cloth shading, lens distortion and blur, noise, motion blur in every "
    "third, a forearm or sleeve, a face, things of the room. The hand before the camera is the "
    "tracker's, or another whose bones, radii and size differ by 4.5, 5 and 2 % (standard deviations). "
    "100 frames held out; constants were chosen on others. Colours were learned from eight photographs. "
    "Reprojection is the root mean square distance of the skin's vertices in the picture. The paper "
    f"tells no error of joints; its depth errors are {PAPER_DEPTH_MM[0]} to {PAPER_DEPTH_MM[1]} mm. "
    f"Its times: {PAPER_MS} ms a frame (image, "
    "look-up, inverse kinematics). Ours are processor times of one thread."
)


def poses_parts(
    chain: Sequence[ChainRow], depth: Sequence[DepthRow], motion: Sequence[MotionRow]
) -> tuple[tuple[str, ...], tuple[Demand, ...]]:
    parts: list[str] = []
    demands: list[Demand] = []
    if chain:
        cells = []
        for row in sorted(chain, key=lambda row: (row.cameras, HANDS.index(row.hand))):
            found, mark = _demands(row), "-"
            demands += found
            if (row.cameras, row.hand, row.stage) in MUST:
                mark = found[0].mark()
            cells.append(_chain_cells(row, mark))
        parts += [table(CHAIN_HEADS, cells), f"<p>{NOTE}</p>"]
    if depth:
        parts.append(figure(_depths(depth), "Figure 12: error of depth by distance, dense refinement."))
    if motion:
        parts += [
            figure(_motions(motion), "Figure 11 with the error that it lacks: means over the sequences."),
            table(MOTION_HEADS, [_motion_cells(row) for row in motion]),
        ]
    return tuple(parts), tuple(demands)


def _demands(row: ChainRow) -> list[Demand]:
    """What the issue asks of one row, the joint error first."""
    name = f"{row.stage}, {row.cameras} camera{'s' if row.cameras > 1 else ''}, {row.hand} hand"
    found = []
    if (row.cameras, row.hand, row.stage) in MUST:
        most = MUST[row.cameras, row.hand, row.stage]
        found.append(Demand(f"mean joint error, {name}", row.joint_mae_deg, most, "degrees"))
    if row.cameras == 2 and row.stage == "dense":
        outside, inside = 100 * (1 - row.accepted_coverage), 100 * row.accepted_coverage
        found += [
            Demand(f"RMS of accepted joints, {name}", row.accepted_rms_deg, MOST_RMS_DEG, "degrees"),
            Demand(f"joints not accepted, {name}", 100 * (1 - row.accepted), 100 * (1 - LEAST_ACCEPTED), "%"),
            Demand(f"accepted joints outside, {name}", outside, 100 * (1 - COVERAGE[0]), "%"),
            Demand(f"accepted joints inside, {name}", inside, 100 * COVERAGE[1], "%"),
        ]
    if row.cameras == 1 and row.stage == "ik":
        found.append(Demand(f"whole chain, {name}", row.image_ms + row.pose_ms, MOST_CHAIN_MS, "ms"))
    return found


def _chain_cells(row: ChainRow, mark: str) -> tuple[str, ...]:
    sure = row.accepted > 0
    return (
        str(row.cameras), row.hand, row.stage, f"{row.joint_mae_deg:.1f}", mark, f"{row.orientation_deg:.1f}",
        f"{row.depth_mm:.1f}", f"{row.aside_mm:.1f}", f"{row.reprojection_px:.1f}",
        f"{100 * row.coverage:.0f} %", f"{100 * row.accepted:.0f} %",
        f"{row.accepted_rms_deg:.1f}" if sure else "-",
        f"{100 * row.accepted_coverage:.0f} %" if sure else "-",
        f"{row.image_ms:.1f}", f"{row.pose_ms:.1f}",
    )  # fmt: skip


def _motion_cells(row: MotionRow) -> tuple[str, ...]:
    return (
        row.sequence, row.hand, _method(row), f"{row.joint_mae_deg:.1f}", f"{row.depth_mm:.1f}",
        f"{row.reprojection_px:.1f}", f"{row.jitter_deg:.2f}", f"{row.true_jitter_deg:.2f}",
        f"{row.jitter_mm:.2f}", f"{row.true_jitter_mm:.2f}",
    )  # fmt: skip


def _method(row: MotionRow) -> str:
    return f"{row.stage}, followed" if row.follows else row.stage


def _depths(rows: Sequence[DepthRow]) -> str:
    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.axhspan(*PAPER_DEPTH_MM, color=QUIET, alpha=0.4, label="the paper, one camera")
        for cameras, colour in ((1, FLOOR), (2, MODEL)):
            for whose, marker in zip(HANDS, "o+", strict=True):
                own = [row for row in rows if (row.cameras, row.hand) == (cameras, whose)]
                axes.plot(
                    [row.distance_mm for row in own], [row.depth_error_mm for row in own], marker,
                    color=colour, markersize=4, label=f"{cameras} camera{'s' * (cameras > 1)}, {whose} hand",
                )  # fmt: skip
        axes.set_yscale("symlog", linthresh=1.0)
        axes.set_yticks((0, 1, 3, 10, 30, 100), ("0", "1", "3", "10", "30", "100"))
        axes.minorticks_off()
        axes.set_ylim(bottom=0)
        axes.set_xlabel("distance from the first camera, mm")
        axes.set_ylabel("error of depth, mm")
        axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1, 1))

    return figure_svg(draw, 7.5, 3.4)


def _motions(rows: Sequence[MotionRow]) -> str:
    methods = list(dict.fromkeys(_method(row) for row in rows))
    shown = (
        ("joint_mae_deg", "mean error of joints, degrees"),
        ("reprojection_px", "reprojection, px"),
        ("jitter_deg", "jitter of joints, degrees"),
        ("jitter_mm", "jitter of depth, mm"),
    )

    def draw(figure: Figure) -> None:
        for axes, (name, label) in zip(figure.subplots(1, len(shown)), shown, strict=True):
            for number, (whose, colour) in enumerate(zip(HANDS, (MODEL, FLOOR), strict=True)):
                own = [row for row in rows if row.hand == whose]
                means = [
                    np.mean([getattr(row, name) for row in own if _method(row) == method])
                    for method in methods
                ]
                places = np.arange(len(methods)) + 0.4 * number - 0.2
                axes.barh(places, means, 0.38, color=colour, label=f"{whose} hand")
            axes.set_yticks(range(len(methods)), methods if axes is figure.axes[0] else [""] * len(methods))
            axes.invert_yaxis()
            axes.set_xlabel(label)
        figure.axes[0].legend(fontsize=8, loc="lower left", bbox_to_anchor=(0, 1), ncols=2)

    return figure_svg(draw, 10.5, 3.2)
