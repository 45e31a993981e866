"""The skeleton as JSON, for viewers in any language (format ``glovecal.skeleton.v1``).

    format       "glovecal.skeleton.v1"
    hand         "right" or "left"
    length_unit, angle_unit   "mm", "deg"
    dimensions   every size of the hand, and which of them were measured
    rotations    name, low and high limit; what stands in when it is not measured: a weighted sum of other
                 rotations (rule), or an angle (rest)
    joints       parents before children: name, parent (null for the forearm), offset, orientation
                 (quaternion w, x, y, z), axis, rotations (the joint's angle is the sum of weight x rotation)
    tips         finger, joint it hangs on, offset in that joint's frame

    frame(joint) = frame(parent) . translate(offset) . orient(orientation) . turn(axis, angle)

Right-handed frames, positive angles by the right-hand rule. Origin at the wrist's centre, x along the middle
metacarpal to the fingers, z out of the back of the hand; y points to the thumb of a right hand.
"""

from __future__ import annotations

from typing import Any

from glovecal_models.hand.rotations import FINGERS, FLAT_PALM_DEG, PALM, REST_DEG, RULES
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.hand_ranges import ACTIVE_RANGE_DEG

FORMAT = "glovecal.skeleton.v1"


def skeleton_document(skeleton: Skeleton) -> dict[str, Any]:
    """Plain JSON-able data."""
    return {
        "format": FORMAT,
        "hand": skeleton.hand,
        "length_unit": "mm",
        "angle_unit": "deg",
        "dimensions": {
            "sizes": dict(skeleton.dimensions.sizes_mm),
            "measured": list(skeleton.dimensions.measured),
        },
        "rotations": [_rotation(name) for name in skeleton.rotations],
        "joints": [
            {
                "name": joint.name,
                "parent": joint.parent,
                "offset": list(joint.offset_mm),
                "orientation": list(joint.orientation),
                "axis": list(joint.axis),
                "rotations": dict(joint.rotations),
            }
            for joint in skeleton.joints
        ],
        "tips": [
            {"finger": FINGERS[tip.finger], "joint": tip.joint, "offset": list(tip.offset_mm)}
            for tip in skeleton.tips
        ],
    }


def _rotation(name: str) -> dict[str, Any]:
    low, high = ACTIVE_RANGE_DEG[name]
    if name in RULES:
        missing = {"rule": RULES[name], "rest": None}
    else:
        missing = {"rule": None, "rest": FLAT_PALM_DEG if name == PALM else REST_DEG[name]}
    return {"name": name, "low": low, "high": high, **missing}
