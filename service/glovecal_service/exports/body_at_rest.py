"""A body that stands at rest with its arms out to the sides, to which calibrated hands are joined.

Krnoul et al. 2016 (section 3.3.2) map the gloves onto the skeleton of a whole character, so that the same
model takes motion capture of the body and can be retargeted. Segment lengths are shares of stature (Drillis &
Contini 1966, as in Winter, "Biomechanics and Motor Control of Human Movement"); the stature follows from the
hand's length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

HAND_LENGTH_SHARE = 0.108
"""Of the stature, from the wrist to the tip of the middle finger."""
ROOT = "Hips"
_HIP_HEIGHT, _SHOULDER_HEIGHT, _NECK_HEIGHT = 0.530, 0.818, 0.870
_SHOULDER_HALF, _HIP_HALF = 0.129, 0.0955
_UPPER_ARM, _FOREARM, _THIGH, _SHANK, _FOOT_HEIGHT, _FOOT_LENGTH = 0.186, 0.146, 0.245, 0.246, 0.039, 0.152
_SPINE = (_SHOULDER_HEIGHT - _HIP_HEIGHT) / 3
_CLAVICLE = 0.02

SIDES = {"L": "Left", "R": "Right"}
_SHARES: dict[str, tuple[str | None, tuple[float, float, float]]] = {
    ROOT: (None, (0.0, _HIP_HEIGHT, 0.0)),
    "Spine": (ROOT, (0.0, _SPINE, 0.0)),
    "Spine1": ("Spine", (0.0, _SPINE, 0.0)),
    "Neck": ("Spine1", (0.0, _SPINE + _NECK_HEIGHT - _SHOULDER_HEIGHT, 0.0)),
    "Head": ("Neck", (0.0, 0.5 * (1.0 - _NECK_HEIGHT), 0.0)),
}
"""Parent and offset of each bone, in statures: x to the body's left, y up, z forward."""
for _side, _sign in (("Left", 1.0), ("Right", -1.0)):
    _SHARES |= {
        f"{_side}UpLeg": (ROOT, (_sign * _HIP_HALF, 0.0, 0.0)),
        f"{_side}Leg": (f"{_side}UpLeg", (0.0, -_THIGH, 0.0)),
        f"{_side}Foot": (f"{_side}Leg", (0.0, -_SHANK, 0.0)),
        f"{_side}ToeBase": (f"{_side}Foot", (0.0, -_FOOT_HEIGHT, _FOOT_LENGTH / 2)),
        f"{_side}Shoulder": ("Spine1", (_sign * _CLAVICLE, _SPINE, 0.0)),
        f"{_side}Arm": (f"{_side}Shoulder", (_sign * (_SHOULDER_HALF - _CLAVICLE), 0.0, 0.0)),
        f"{_side}ForeArm": (f"{_side}Arm", (_sign * _UPPER_ARM, 0.0, 0.0)),
    }
_ENDS = {"Head": (0.0, 0.5 * (1.0 - _NECK_HEIGHT), 0.0)} | {
    f"{side}ToeBase": (0.0, 0.0, _FOOT_LENGTH / 2) for side in ("Left", "Right")
}

PALM_DOWN = {
    "R": np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]),
    "L": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
}
"""(3, 3) the hand's axes in the body's: fingers to the side, back of the hand up, thumb forward."""


@dataclass(frozen=True)
class Bone:
    """Its frame is parallel to the body's when nothing is turned."""

    name: str
    parent: str | None
    offset_mm: tuple[float, float, float]
    """In the frame of its parent."""
    end_mm: tuple[float, float, float] | None = None
    """Where the bone ends, if nothing hangs on it."""


def body_at_rest(hand_length_mm: float) -> list[Bone]:
    """Parents before children; the forearms come without hands."""
    stature = hand_length_mm / HAND_LENGTH_SHARE

    def scaled(share: tuple[float, float, float]) -> tuple[float, float, float]:
        x, y, z = share
        return x * stature, y * stature, z * stature

    return [
        Bone(name, parent, scaled(offset), scaled(_ENDS[name]) if name in _ENDS else None)
        for name, (parent, offset) in _SHARES.items()
    ]


def wrist_offset_mm(hand_length_mm: float, label: str) -> tuple[float, float, float]:
    """Of a hand's wrist from its elbow, in the body's axes."""
    length = _FOREARM * hand_length_mm / HAND_LENGTH_SHARE
    return (-length if label == "R" else length), 0.0, 0.0
