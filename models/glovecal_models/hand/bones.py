"""The hand as bones, as animation tools know it: joints that lie in one place turn one bone.

A bone's frame is that of its joints, all of them turned: x along the bone, z out of its back (for the thumb
and the fingertips: out of the nail), y towards the thumb of a right hand. The first bone is the hand itself,
whose frame is that of the wrist.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.rotations import FINGERS
from glovecal_models.hand.skeleton import Skeleton

HAND = "hand"
METACARPAL, PROXIMAL, INTERMEDIATE, DISTAL = "metacarpal", "proximal", "intermediate", "distal"
PHALANGES: dict[str, tuple[str, ...]] = {
    name: (METACARPAL, PROXIMAL, DISTAL) if letter == "T" else (PROXIMAL, INTERMEDIATE, DISTAL)
    for letter, name in FINGERS.items()
}
"""The bones of each finger that turn, from the palm to the tip."""
_PARTS = {"T_VIR": METACARPAL, "T_MCP": PROXIMAL, "T_IP": DISTAL, "P_CMC": METACARPAL} | {
    f"{finger}_{joint}": part
    for finger in "IMRP"
    for joint, part in (("MCP", PROXIMAL), ("PIP", INTERMEDIATE), ("DIP", DISTAL))
}
"""The bone that a joint is the last to turn."""


@dataclass(frozen=True)
class HandBones:
    """B bones of one hand; parents before children."""

    skeleton: Skeleton
    names: tuple[str, ...]
    """``hand``, ``thumb_metacarpal``, ``index_proximal``, and so on."""
    parents: tuple[int | None, ...]
    """None for the hand, which hangs on the forearm."""
    joints: tuple[int, ...]
    """The last of the skeleton's joints that turn each bone: its frame is the bone's."""
    heads_mm: np.ndarray
    """(B, 3) where each bone begins, in its parent's frame."""
    tails_mm: np.ndarray
    """(B, 3) where each bone ends, in its own frame: the next bone's head, or the fingertip; of the hand the
    middle finger's knuckle."""

    @classmethod
    def of(cls, skeleton: Skeleton) -> HandBones:
        """Two hands of one anatomy have the same bones in the same order."""
        groups = _joints_in_one_place(skeleton)
        joints = [last for _, last in groups]
        names, parents, heads = [], [], []
        for first, last in groups:
            before = skeleton.parents[first]
            names.append(_name(skeleton.joints[last].name))
            parents.append(None if before is None else joints.index(before))
            heads.append(skeleton.offsets_mm[first])
        tips = {tip.joint: np.array(tip.offset_mm) for tip in skeleton.tips}
        tails = []
        for bone, joint in enumerate(joints):
            tip = tips.get(skeleton.joints[joint].name)
            tails.append(heads[_next(names, parents, bone)] if tip is None else tip)
        return cls(skeleton, tuple(names), tuple(parents), tuple(joints), np.array(heads), np.array(tails))

    def orientations(self, angles_deg: np.ndarray) -> np.ndarray:
        """(N, B, 3, 3) in the forearm's frame, columns are the bones' axes; of ``angles_deg`` (N, R) in the
        order of the skeleton's rotations. Raises BadInput as ``forward_kinematics``."""
        return forward_kinematics(self.skeleton, angles_deg).orientations[:, list(self.joints)]

    def posed(self, angles_deg: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """``orientations``, and (N, B, 2, 3) mm in the forearm's frame where each bone begins and ends."""
        frames = forward_kinematics(self.skeleton, angles_deg)
        joints = list(self.joints)
        heads, turned = frames.joints_mm[:, joints], frames.orientations[:, joints]
        tails = heads + (turned @ self.tails_mm[:, :, None])[..., 0]
        return turned, np.stack([heads, tails], axis=2)

    @cached_property
    def straight(self) -> np.ndarray:
        """(B, 3, 3) orientations with every rotation at zero: flat hand, fingers straight, thumb closed."""
        return self.orientations(np.zeros((1, len(self.skeleton.rotations))))[0]


def _joints_in_one_place(skeleton: Skeleton) -> list[tuple[int, int]]:
    """First and last of the joints that turn one bone."""
    here = [not np.any(offset) for offset in skeleton.offsets_mm]
    groups = []
    for joint, parent in enumerate(skeleton.parents):
        if parent is not None and here[joint]:
            continue
        last = joint
        while last + 1 < len(here) and here[last + 1] and skeleton.parents[last + 1] == last:
            last += 1
        groups.append((joint, last))
    return groups


def _name(joint: str) -> str:
    finger = joint.partition("_")[0]
    return HAND if finger == "W" else f"{FINGERS[finger]}_{_PARTS[joint]}"


def _next(names: list[str], parents: list[int | None], bone: int) -> int:
    children = [child for child, parent in enumerate(parents) if parent == bone]
    middle = next((child for child in children if names[child].startswith(FINGERS["M"])), None)
    return children[0] if middle is None else middle
