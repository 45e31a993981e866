"""A hand as named triples of numbers, as marker files hold them.

Places of joints are triples by nature. Angles and readings are grouped as Krnoul et al. 2016 (Figure 1) do:
for each finger abduction, metacarpal and proximal flexion as X, Y and Z.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.rotations import FINGERS, WRIST, completed
from glovecal_service.exports.hand_motion import Content, HandMotion

TRIPLES: dict[str, tuple[str, ...]] = {
    "thumb": ("TI_ABD", "T_MCP", "T_IP"),
    "thumb_roll": ("T_TMC",),
    "index": ("IM_ABD", "I_MCP", "I_PIP"),
    "index_distal": ("I_DIP",),
    "middle": ("", "M_MCP", "M_PIP"),
    "middle_distal": ("M_DIP",),
    "ring": ("MR_ABD", "R_MCP", "R_PIP"),
    "ring_distal": ("R_DIP",),
    "pinky": ("RP_ABD", "P_MCP", "P_PIP"),
    "pinky_distal": ("P_DIP",),
    "palm": ("PALM_ARCH",),
    "wrist": ("W_FLEX", "W_ABD"),
}
"""Channels of each marker, X first; another channel has a marker of its own name."""
PLACES = {
    "wrist": "W_FLEX",
    "pinky_cmc": "P_CMC",
    "thumb_cmc": "T_TMC",
    "thumb_mcp": "T_MCP",
    "thumb_ip": "T_IP",
    **{
        f"{name}_{joint.lower()}": f"{letter}_{joint}"
        for letter, name in FINGERS.items()
        if letter != "T"
        for joint in ("MCP", "PIP", "DIP")
    },
}
"""Where joints are, those that the hand has; flexion and abduction of a knuckle are one marker."""


def markers(motion: HandMotion, content: Content) -> dict[str, np.ndarray]:
    """(N, 3) by name; NaN where something is missing. Raises BadInput where nothing is calibrated."""
    if content == "raw":
        return _grouped(motion, motion.sensors, motion.readings)
    motion.require_angles(content)
    if content == "angles":
        return _grouped(motion, motion.rotations, motion.degrees)
    degrees = motion.degrees
    if motion.wrist == "optical":
        is_wrist = [name in WRIST for name in motion.rotations]
        degrees = np.where(is_wrist, 0.0, degrees)
    angles = completed(motion.rotations, degrees, motion.skeleton.rotations)
    frames = forward_kinematics(motion.skeleton, angles)
    names = [joint.name for joint in motion.skeleton.joints]
    found = {
        name: frames.joints_mm[:, names.index(joint)] for name, joint in PLACES.items() if joint in names
    }
    tips = zip(motion.skeleton.tips, frames.tips_mm.swapaxes(0, 1), strict=True)
    found |= {f"{FINGERS[tip.finger]}_tip": place for tip, place in tips}
    if motion.frame is not None:
        found = {name: motion.frame.placed(place) for name, place in found.items()}
    unknown = np.isnan(motion.degrees).all(axis=1, keepdims=True)
    hand = {f"{motion.label}_{name}": np.where(unknown, np.nan, at) for name, at in found.items()}
    return hand | dict(motion.beside)


def _grouped(motion: HandMotion, names: Sequence[str], values: np.ndarray) -> dict[str, np.ndarray]:
    channels: Mapping[str, np.ndarray] = dict(zip(names, values.T, strict=True))
    groups = {name: own for name, own in TRIPLES.items() if any(channel in channels for channel in own)}
    grouped = {channel for own in groups.values() for channel in own}
    groups |= {name: (name,) for name in names if name not in grouped}
    nothing = np.zeros(len(motion.time_s))
    found = {}
    for name, own in groups.items():
        triple = [channels.get(channel, nothing) for channel in (*own, "", "")[:3]]
        columns = np.column_stack(triple)
        missing = np.isnan(columns).any(axis=1, keepdims=True)
        found[f"{motion.label}_{name}"] = np.where(missing, np.nan, columns)
    return found
