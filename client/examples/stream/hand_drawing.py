"""A hand as rounded bones, seen from anywhere: its capsules sorted by depth."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.skeleton import Skeleton
from stream.drawing import Drawing

THICKNESS_MM = {"T": 17.0, "I": 14.0, "M": 14.5, "R": 13.5, "P": 12.0}
EDGE = "#40352c"
COLOURS = {"T": "#c65f3a", "I": "#3b76b8", "M": "#3f9263", "R": "#8a63ad", "P": "#b68a2c", "": "#d7c3b0"}


def bones_of(skeleton: Skeleton, angles_deg: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """Finger and two ends (2, 3) in mm of each bone, in the forearm's frame; "" is the palm."""
    frames = forward_kinematics(skeleton, angles_deg[None])
    joints = dict(zip((joint.name for joint in skeleton.joints), frames.joints_mm[0], strict=True))
    wrist, found = np.zeros(3), []
    for tip, at in zip(skeleton.tips, frames.tips_mm[0], strict=True):
        names = ("T_TMC", "T_MCP", "T_IP") if tip.finger == "T" else ("_MCP", "_PIP", "_DIP")
        chain = [joints[name if name.startswith("T_") else tip.finger + name] for name in names] + [at]
        found.append(("", np.array([wrist, chain[0]])))
        found += [(tip.finger, np.array(ends)) for ends in pairwise(chain)]
    knuckles = [joints[f"{finger}_MCP"] for finger in "IMRP"]
    return found + [("", np.array(ends)) for ends in pairwise(knuckles)]


def hand_drawing(
    skeleton: Skeleton, angles_deg: np.ndarray, view: np.ndarray, size: float, hand_mm: float = 230.0
) -> Drawing:
    """``view`` (3, 3): rows are right, up and towards the eye, in the forearm's frame."""
    drawing, scale = Drawing(size, size), size / hand_mm
    bones = [(finger, ends @ view.T) for finger, ends in bones_of(skeleton, angles_deg)]
    middle = np.array([95.0, 0.0, 0.0]) @ view.T
    for finger, ends in sorted(bones, key=lambda bone: bone[1][:, 2].mean()):
        flat = (ends[:, :2] - middle[:2]) * (scale, -scale) + size / 2
        thick = THICKNESS_MM.get(finger, 22.0) * scale
        drawing.line(flat, EDGE, thick + 1.5)
        drawing.line(flat, COLOURS[finger], thick)
    return drawing


PALM_VIEW = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""The palm of a right hand towards the eye, fingers up."""
