"""Where a worn hand's bones point in Unity's axes, the hand itself in T-pose: by the kinematics alone."""

from __future__ import annotations

import numpy as np
from bridge_support import FLAT, WornHand

from glovecal_models.hand.bones import PHALANGES, HandBones
from glovecal_models.hand.rotations import HAND_ROTATIONS

TO_UNITY = {"right": lambda p: np.array([p[0], p[2], p[1]]), "left": lambda p: np.array([-p[0], p[2], -p[1]])}


def in_unity(
    worn: WornHand, angles: dict[str, float]
) -> dict[tuple[str, int], tuple[np.ndarray, np.ndarray]]:
    """By finger and bone (0 to 2 from the palm): the direction along it, and that out of its back or nail."""
    bones = HandBones.of(worn.skeleton)
    turned = bones.orientations(np.array([[{**FLAT, **angles}[name] for name in HAND_ROTATIONS]]))[0]
    in_hand, to_unity = turned[0].T @ turned, TO_UNITY[worn.hand]
    directions = {}
    for finger, parts in PHALANGES.items():
        for number, part in enumerate(parts):
            axes = in_hand[bones.names.index(f"{finger}_{part}")]
            directions[finger, number] = to_unity(axes[:, 0]), to_unity(axes[:, 2])
    return directions
