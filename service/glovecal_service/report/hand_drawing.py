"""A hand drawn as bones, seen from one side."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes

from glovecal_models.hand.forward_kinematics import HandFrames
from glovecal_models.hand.skeleton import Skeleton
from glovecal_service.report.drawing import QUIET

View = Literal["from the back", "from the thumb's side"]
_SEEN: dict[View, np.ndarray] = {
    "from the back": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0]]),
    "from the thumb's side": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
}
"""Each view's right and up, in the skeleton's frame; the fingers of a flat hand point up."""
SCALE_MM = 50.0


def draw_hand(
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


def draw_scale(axes: Axes, view: View) -> None:
    """The view's name above, and a bar of ``SCALE_MM`` below the wrist."""
    axes.set_title(view)
    axes.plot([-SCALE_MM, 0.0], [-12.0, -12.0], color=QUIET, linewidth=3, solid_capstyle="butt")
    axes.text(-SCALE_MM / 2, -16.0, f"{SCALE_MM:.0f} mm", ha="center", va="top", fontsize=8)


def _lines(skeleton: Skeleton, frames: HandFrames, frame: int) -> list[np.ndarray]:
    """Palm to tip of each finger, and across the knuckles; each (K, 3)."""
    fingers = []
    for tip, last in enumerate(skeleton.tip_joints):
        joints = frames.joints_mm[frame, list(skeleton.carrying(last))]
        fingers.append(np.vstack([joints, frames.tips_mm[frame, tip]]))
    names = [joint.name for joint in skeleton.joints]
    knuckles = frames.joints_mm[frame, [names.index(f"{finger}_MCP") for finger in "IMRP"]]
    return [*fingers, knuckles]
