"""What angles a named pose has: as the subject's own takes show it, else as a usual hand takes it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from glovecal_models.quick_check.held_poses import held_poses
from glovecal_models.takes.take import Take

REPEAT_SD_DEG = 2.5
"""How far a person's pose is from the last time it was taken."""
OTHER_HAND_SD_DEG = 6.0
"""How far it is from a usual hand's."""
KEY_POSES_DEG: Mapping[str, Mapping[str, float]] = {
    "flat": {f"{finger}_{joint}": 0.0 for finger in "IMRP" for joint in ("MCP", "PIP")}
    | dict.fromkeys(("IM_ABD", "MR_ABD", "RP_ABD", "T_MCP", "T_IP"), 3.0),
    "fist": {f"{finger}_MCP": 86.0 for finger in "IMRP"} | {f"{finger}_PIP": 95.0 for finger in "IMRP"},
    "spread": {f"{finger}_{joint}": 0.0 for finger in "IMRP" for joint in ("MCP", "PIP")}
    | dict.fromkeys(("IM_ABD", "MR_ABD", "RP_ABD"), 24.0),
}
"""The key poses that every hand takes much alike (Wang & Neff 2013, section 5.1.1); joints that people hold
differently in them are not given."""


@dataclass(frozen=True)
class KnownPose:
    """Angles of one pose by rotation, and how well they are known. Degrees."""

    angles: Mapping[str, float]
    sd: Mapping[str, float]


PoseBook = Mapping[str, KnownPose]


def usual_poses() -> dict[str, KnownPose]:
    """Flat, fist and spread of a usual hand."""
    return {
        name: KnownPose(angles, dict.fromkeys(angles, OTHER_HAND_SD_DEG))
        for name, angles in KEY_POSES_DEG.items()
    }


def own_poses(takes: Iterable[Take], ranges: Mapping[str, float]) -> dict[str, KnownPose]:
    """The poses that ``takes`` name, with the angles measured while they were held; usual ones beside them.

    ``ranges`` is each sensor's trained range, in readings.
    """
    seen: dict[str, dict[str, list[float]]] = {}
    for take in takes:
        if take.poses is None or not take.rotations:
            continue
        reference = take.reference_at_frames(take.rotations)
        for pose in held_poses(take, ranges)[0]:
            for column, rotation in enumerate(take.rotations):
                angles = reference[pose.frames, column]
                if np.isfinite(angles).any():
                    measured = float(np.nanmean(angles))
                    seen.setdefault(pose.name, {}).setdefault(rotation, []).append(measured)
    return usual_poses() | {name: _known(angles) for name, angles in seen.items()}


def _known(angles: Mapping[str, list[float]]) -> KnownPose:
    """Means; the next time the pose is off by as much as from time to time before."""
    means = {rotation: float(np.mean(values)) for rotation, values in angles.items()}
    sd = {}
    for rotation, values in angles.items():
        # One time alone tells no spread: it leans on the usual one, as if seen twice before.
        square = (np.var(values) * len(values) + 2 * REPEAT_SD_DEG**2) / (len(values) + 1)
        sd[rotation] = float(np.sqrt(square * (1 + 1 / len(values))))
    return KnownPose(means, sd)
