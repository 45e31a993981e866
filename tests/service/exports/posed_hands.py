"""Hands in motion that are made up, and where a file on the body's skeleton has to put their joints."""

from __future__ import annotations

import numpy as np

from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.rotations import FINGERS
from glovecal_models.hand.skeleton import Palm, hand_skeleton
from glovecal_service.exports.body_motion import END, PALM_DOWN, SIDES
from glovecal_service.exports.hand_motion import HandMotion

AGREES_MM = 1e-3
RATE_HZ = 60.0
Places = dict[str, np.ndarray]


def moving(label: str = "R", palm: Palm = "rigid", count: int = 12, rate_hz: float = RATE_HZ) -> HandMotion:
    dimensions = HandDimensions.from_measured({"hand_length": 178.0 if label == "L" else 190.0})
    skeleton = hand_skeleton(dimensions, "left" if label == "L" else "right", palm)
    time_s = 3.0 + np.arange(count) / rate_hz
    degrees = 35 + 45 * np.sin(9 * time_s[:, None] + np.arange(len(skeleton.rotations)) + (label == "L"))
    return HandMotion(
        label, time_s, (), np.empty((count, 0)), skeleton.rotations, degrees, np.full_like(degrees, 1.5),
        skeleton, notes={"take": "wave", "model": "0" * 64},
    )  # fmt: skip


def expected(motion: HandMotion, frame: int) -> Places:
    """From the wrist, in the body's axes, by the kinematics of the hand."""
    frames = forward_kinematics(motion.skeleton, motion.degrees[[frame]])
    names = [joint.name for joint in motion.skeleton.joints]
    turned, side = PALM_DOWN[motion.label], SIDES[motion.label]
    bones = {"T_VIR": "Thumb1", "T_MCP": "Thumb2", "T_IP": "Thumb3"} | {
        f"{letter}_{joint}": f"{FINGERS[letter].capitalize()}{number}"
        for letter in "IMRP"
        for number, joint in enumerate(("MCP", "PIP", "DIP"), 1)
    }
    found = {f"{side}Hand{bone}": frames.joints_mm[0, names.index(joint)] for joint, bone in bones.items()}
    tips = zip(motion.skeleton.tips, frames.tips_mm[0], strict=True)
    found |= {f"{side}Hand{FINGERS[tip.finger].capitalize()}3{END}": place for tip, place in tips}
    return {name: turned @ place for name, place in found.items()}


def worst_mm(places: Places, motion: HandMotion, frame: int) -> float:
    wrist = places[f"{SIDES[motion.label]}Hand"]
    wanted = expected(motion, frame)
    return max(float(np.abs(places[name] - wrist - place).max()) for name, place in wanted.items())
