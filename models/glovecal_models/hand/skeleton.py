"""The hand's skeleton: one definition, for computation and for every viewer.

Frame of the right hand, palm down: origin at the wrist's centre, x along the middle metacarpal to the
fingers, y towards the thumb, z out of the back of the hand. The left hand is the mirror image in y = 0. Each
joint turns about one axis; its frame follows from that of its parent:

    frame(joint) = frame(parent) . translate(offset) . orient(orientation) . turn(axis, angle)

The palm is rigid, or it arches: then the little finger's metacarpal turns about its base, as the thumb's does
(Krnoul et al. 2016, section 3.3.3). With a flat palm the two hands are equal.

The first joint's parent is the forearm. A joint's angle is a weighted sum of rotations: the spread between
ring and middle finger carries the pinky too, so the pinky's spread is ``MR_ABD`` + ``RP_ABD``. The middle
finger is what the others spread from.

About which axes the thumb's two sensors turn its metacarpal: a rotation of that bone's local frame.

Krnoul et al. 2016, section 3.3.2: bones of character models turn about their own direction, which does not
suit the thumb. A post-rotation of the bone's frame makes the roll sensor turn about x alone, and the
abduction sensor about y alone. The paper's angles, (-39, -13, 27) degrees for the right hand, belong to its
tool's frame, and it does not tell the order of the three turns: they are a setting here (``PAPER_DEG`` and an
order), and no default. Ours follows from what the sensors do: the frame whose x and y are the two axes of the
skeleton. The left hand is the mirror image, axes and all.

The skeleton as JSON, for viewers in any language (format ``glovecal.skeleton.v1``).

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

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.dimensions import DIMENSIONS, HandDimensions
from glovecal_models.hand.rotations import (
    ACTIVE_RANGE_DEG,
    ARCHING_ROTATIONS,
    FINGERS,
    FLAT_PALM_DEG,
    HAND_ROTATIONS,
    PALM,
    REST_DEG,
    RULES,
    WRIST,
    Handedness,
    known_hand,
)
from glovecal_models.names import did_you_mean

PAPER_DEG = (-39.0, -13.0, 27.0)
ORDERS = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")
"""Each turn about an axis of the frame that the turns before have left."""
Axis = tuple[float, float, float]
Palm = Literal["rigid", "arching"]
Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
NO_TURN: Quaternion = (1.0, 0.0, 0.0, 0.0)

THUMB_TILT_DEG = 8.0
"""How far the closed thumb points out of the palm's plane."""
THUMB_SLANT_DEG = 40.0
"""Between the axis about which the thumb turns across the palm and the middle metacarpal."""
THUMB_ROLL_DEG = 50.0
"""How far the closed thumb's nail has turned from the back of the hand towards the side."""
THUMB_BASE_DEPTH = 0.03
"""Of the thumb's base below the wrist's centre, in hand lengths.

These four are ours: nobody measures them on a subject. With them the relaxed thumb is pronated by 76 degrees
to the middle metacarpal (its base by 80: Cooney et al. 1981, J. Bone Joint Surg. 63-A, 1371-1381), and the
posture that the paper calls "ok" brings thumb and index finger together within 10 mm.
"""

PALM_SLANT_DEG = 35.0
"""Between the axis about which the little finger's metacarpal turns and the axis of pure flexion: a palm that
arches also turns the little finger to the thumb. Ours; the paper gives no axis. About 25 degrees of arch
(``hand_ranges``) its knuckle comes some 22 mm out of the palm's plane.
"""
FORMAT = "glovecal.skeleton.v1"


@dataclass(frozen=True)
class ThumbAxes:
    """In the frame of the closed thumb's metacarpal: x along the bone, z out of its nail's side."""

    roll: Axis
    """About which the roll sensor's rotation turns (T_TMC), a unit vector."""
    abduction: Axis
    """Of the thumb-index abduction (TI_ABD), across ``roll``."""

    @classmethod
    def rotated(cls, angles_deg: Sequence[float], order: str) -> ThumbAxes:
        """x and y of a frame turned by ``angles_deg`` about x, y and z, one after another in ``order``.

        Raises BadInput for another order, and for angles that are not three finite numbers.
        """
        from scipy.spatial.transform import Rotation  # slow to load, and seldom needed

        if order not in ORDERS:
            raise BadInput(f"order of the thumb's turns is {order!r}; {did_you_mean(order, ORDERS)}")
        if len(angles_deg) != 3 or not np.isfinite(angles_deg).all():
            raise BadInput(
                f"the thumb's post-rotation is {tuple(angles_deg)}, expected three angles, degrees"
            )
        by_axis = dict(zip("XYZ", angles_deg, strict=True))
        turned = Rotation.from_euler(order, [by_axis[axis] for axis in order], degrees=True).as_matrix()
        x, y, _ = turned.T.tolist()
        return cls(tuple(x), tuple(y))

    def angles_deg(self, order: str) -> Axis:
        """The post-rotation about x, y and z that ``rotated`` makes these axes of."""
        from scipy.spatial.transform import Rotation

        if order not in ORDERS:
            raise BadInput(f"order of the thumb's turns is {order!r}; {did_you_mean(order, ORDERS)}")
        frame = np.column_stack([self.roll, self.abduction, np.cross(self.roll, self.abduction)])
        with warnings.catch_warnings():  # where the middle turn is 90 degrees, one of many answers is given
            warnings.simplefilter("ignore", UserWarning)
            turned = Rotation.from_matrix(frame).as_euler(order, degrees=True)
        found = dict(zip(order, turned.tolist(), strict=True))
        return found["X"], found["Y"], found["Z"]


@dataclass(frozen=True)
class Joint:
    """One axis. Offset and orientation are those in its parent's frame at angle 0."""

    name: str
    parent: str | None
    offset_mm: Vector
    orientation: Quaternion
    """w, x, y, z."""
    axis: Vector
    """Unit vector in the oriented frame; positive angles turn by the right-hand rule."""
    rotations: Mapping[str, float] = field(default_factory=dict)
    """The joint's angle: the sum of weight times rotation."""


@dataclass(frozen=True)
class Tip:
    finger: str
    joint: str
    """The last joint of the finger's chain."""
    offset_mm: Vector


@dataclass(frozen=True)
class Skeleton:
    hand: Handedness
    dimensions: HandDimensions
    joints: tuple[Joint, ...]
    """Parents before children."""
    tips: tuple[Tip, ...]
    """In the order of ``FINGERS``."""

    @cached_property
    def rotations(self) -> tuple[str, ...]:
        """The order of angles of this hand: ``HAND_ROTATIONS``, or ``ARCHING_ROTATIONS``."""
        arches = any(PALM in joint.rotations for joint in self.joints)
        return ARCHING_ROTATIONS if arches else HAND_ROTATIONS

    @cached_property
    def parents(self) -> tuple[int | None, ...]:
        """Index of each joint's parent."""
        places = {joint.name: index for index, joint in enumerate(self.joints)}
        return tuple(None if joint.parent is None else places[joint.parent] for joint in self.joints)

    @cached_property
    def tip_joints(self) -> tuple[int, ...]:
        """Index of each fingertip's joint."""
        names = [joint.name for joint in self.joints]
        return tuple(names.index(tip.joint) for tip in self.tips)

    @cached_property
    def weights(self) -> np.ndarray:
        """(J, R): joint angles are weights @ rotations."""
        rows = [[joint.rotations.get(name, 0.0) for name in self.rotations] for joint in self.joints]
        return np.array(rows)

    @cached_property
    def offsets_mm(self) -> np.ndarray:
        """(J, 3)."""
        return np.array([joint.offset_mm for joint in self.joints])

    @cached_property
    def axes(self) -> np.ndarray:
        """(J, 3)."""
        return np.array([joint.axis for joint in self.joints])

    @cached_property
    def turns(self) -> np.ndarray:
        """(J, 3, 3, 3): a joint's turn is the first matrix + sin(angle) second + (1 - cos(angle)) third."""
        w, x, y, z = np.array([joint.orientation for joint in self.joints]).T
        oriented = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        ).transpose(2, 0, 1)
        cross = np.cross(self.axes[:, None, :], np.eye(3)).swapaxes(1, 2)
        return np.stack([oriented, oriented @ cross, oriented @ cross @ cross], axis=1)

    def carrying(self, joint: int) -> tuple[int, ...]:
        """Indices of the joints from the forearm to ``joint``, both ends in it."""
        chain = [joint]
        while (parent := self.parents[chain[0]]) is not None:
            chain.insert(0, parent)
        return tuple(chain)

    def chain(self, finger: str) -> tuple[str, ...]:
        """The rotations that move a fingertip against the palm, from the palm to the tip."""
        tip = list(FINGERS).index(finger)
        joints = [self.joints[index] for index in self.carrying(self.tip_joints[tip])]
        return tuple(name for joint in joints for name in joint.rotations if name not in WRIST)


def hand_skeleton(
    dimensions: HandDimensions | None = None,
    hand: Handedness = "right",
    palm: Palm = "rigid",
    thumb: ThumbAxes | None = None,
) -> Skeleton:
    """The skeleton of a hand; without ``dimensions`` that of an assumed one, without ``thumb`` with
    ``SENSOR_AXES``."""
    dimensions = HandDimensions.from_measured({}) if dimensions is None else dimensions
    joints = [*_wrist(), *_thumb(dimensions, thumb or SENSOR_AXES)]
    for finger in "IMRP":
        joints += (
            _arching_pinky(dimensions) if (finger, palm) == ("P", "arching") else _finger(finger, dimensions)
        )
    lasts = {"T": "T_IP", **{finger: f"{finger}_DIP" for finger in "IMRP"}}
    tips = [
        Tip(finger, last, (dimensions.sizes_mm[f"{finger}_distal"], 0.0, 0.0))
        for finger, last in lasts.items()
    ]
    right = Skeleton("right", dimensions, tuple(joints), tuple(tips))
    return right if hand == "right" else mirrored(right)


def _wrist() -> list[Joint]:
    return [
        Joint("W_ABD", None, (0.0, 0.0, 0.0), NO_TURN, Z, {"W_ABD": 1.0}),
        Joint("W_FLEX", "W_ABD", (0.0, 0.0, 0.0), NO_TURN, Y, {"W_FLEX": 1.0}),
    ]


def _finger(finger: str, dimensions: HandDimensions) -> list[Joint]:
    """Spread, then knuckle, middle and last joint."""
    x, y = dimensions.knuckle_mm(finger)
    axis, spread = _SPREADS[finger]
    sizes = dimensions.sizes_mm
    bends = [("MCP", (0.0, 0.0, 0.0)), ("PIP", (sizes[f"{finger}_proximal"], 0.0, 0.0))]
    bends.append(("DIP", (sizes[f"{finger}_middle"], 0.0, 0.0)))
    joints = [Joint(f"{finger}_ABD", "W_FLEX", (x, y, 0.0), NO_TURN, axis, spread)]
    for joint, offset in bends:
        name = f"{finger}_{joint}"
        joints.append(Joint(name, joints[-1].name, offset, NO_TURN, Y, {name: 1.0}))
    return joints


def _arching_pinky(dimensions: HandDimensions) -> list[Joint]:
    """The finger, carried by its metacarpal."""
    x, y = dimensions.pinky_base_mm()
    slant = math.radians(PALM_SLANT_DEG)
    base = Joint(
        "P_CMC", "W_FLEX", (x, y, 0.0), NO_TURN, (math.sin(slant), math.cos(slant), 0.0), {PALM: 1.0}
    )
    spread, *bends = _finger("P", dimensions)
    from_base = (spread.offset_mm[0] - x, spread.offset_mm[1] - y, 0.0)
    return [base, replace(spread, parent=base.name, offset_mm=from_base), *bends]


_TOWARDS_PINKY = (0.0, 0.0, -1.0)
_SPREADS: dict[str, tuple[Vector, dict[str, float]]] = {
    "I": (Z, {"IM_ABD": 1.0}),
    "M": (Z, {}),
    "R": (_TOWARDS_PINKY, {"MR_ABD": 1.0}),
    "P": (_TOWARDS_PINKY, {"MR_ABD": 1.0, "RP_ABD": 1.0}),
}


SENSOR_AXES = ThumbAxes(
    (-math.cos(math.radians(THUMB_SLANT_DEG)), math.sin(math.radians(THUMB_SLANT_DEG)), 0.0), Z
)
"""Each of the thumb's two sensors turns one of these."""


def _thumb(dimensions: HandDimensions, axes: ThumbAxes) -> list[Joint]:
    x, y = dimensions.thumb_base_mm()
    base = (x, y, -THUMB_BASE_DEPTH * dimensions.hand_length_mm)
    metacarpal, proximal = (
        (dimensions.sizes_mm[f"T_{part}"], 0.0, 0.0) for part in ("metacarpal", "proximal")
    )
    here, roll = (0.0, 0.0, 0.0), (-1.0, 0.0, 0.0)
    return [
        Joint("T_TMC", "W_FLEX", base, _turn(Y, THUMB_TILT_DEG), axes.roll, {"T_TMC": 1.0}),
        Joint("TI_ABD", "T_TMC", here, NO_TURN, axes.abduction, {"TI_ABD": 1.0}),
        Joint("T_VIR", "TI_ABD", here, _turn(roll, THUMB_ROLL_DEG), roll, {"T_VIR": 1.0}),
        Joint("T_MCP", "T_VIR", metacarpal, NO_TURN, Y, {"T_MCP": 1.0}),
        Joint("T_IP", "T_MCP", proximal, NO_TURN, Y, {"T_IP": 1.0}),
    ]


def _turn(axis: Vector, angle_deg: float) -> Quaternion:
    half = math.radians(angle_deg) / 2
    x, y, z = (math.sin(half) * part for part in axis)
    return math.cos(half), x, y, z


def mirrored(skeleton: Skeleton) -> Skeleton:
    """The other hand, in y = 0. An axis and its angle are mirrored so that the same rotation means the same
    motion."""

    def place(vector: Vector) -> Vector:
        return vector[0], -vector[1], vector[2]

    def axis(vector: Vector) -> Vector:
        return -vector[0], vector[1], -vector[2]

    joints = [
        replace(
            joint,
            offset_mm=place(joint.offset_mm),
            orientation=(joint.orientation[0], *axis(joint.orientation[1:])),
            axis=axis(joint.axis),
        )
        for joint in skeleton.joints
    ]
    tips = [replace(tip, offset_mm=place(tip.offset_mm)) for tip in skeleton.tips]
    other: Handedness = "left" if skeleton.hand == "right" else "right"
    return Skeleton(other, skeleton.dimensions, tuple(joints), tuple(tips))


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


_OFF_UNIT = 1e-6
"""By how much the length of an axis or a quaternion may differ from 1."""
_LEAST_MM, _MOST_MM = 0.0, 1000.0


def skeleton_from_document(document: Any) -> Skeleton:
    """The skeleton that ``skeleton_document`` wrote. Raises BadInput for anything else."""
    whole = _table(document, "skeleton")
    fixed = {"format": FORMAT, "length_unit": "mm", "angle_unit": "deg"}
    for key, expected in fixed.items():
        if whole.get(key) != expected:
            raise BadInput(f"skeleton: {key} is {_shown(whole.get(key))}, expected {expected!r}")
    hand = known_hand(whole.get("hand"))
    if hand is None:
        raise BadInput(f"skeleton: hand is {_shown(whole.get('hand'))}, expected 'right' or 'left'")
    joints: list[Joint] = []
    for item in _list(whole, "joints"):
        joints.append(_joint(item, [joint.name for joint in joints]))
    tips = [_tip(item, [joint.name for joint in joints]) for item in _list(whole, "tips")]
    if [tip.finger for tip in tips] != list(FINGERS):
        raise BadInput(f"skeleton: tips are not those of {', '.join(FINGERS.values())}, in this order")
    sizes = _table(whole.get("dimensions"), "skeleton: dimensions")
    measured = [name for name in _list(sizes, "measured") if name in DIMENSIONS]
    lengths_mm = {
        name: _number(size, f"skeleton: size {name}", _LEAST_MM)
        for name, size in _table(sizes.get("sizes"), "skeleton: sizes").items()
    }
    return Skeleton(hand, HandDimensions(lengths_mm, tuple(measured)), tuple(joints), tuple(tips))


def _joint(item: Any, before: Sequence[str]) -> Joint:
    joint = _table(item, "skeleton: joint")
    name, parent = joint.get("name"), joint.get("parent")
    if not isinstance(name, str) or name in before:
        raise BadInput(f"skeleton: joint {_shown(name)} has no name of its own")
    if parent not in before and not (parent is None and not before):
        raise BadInput(f"skeleton: joint {name} hangs on {_shown(parent)}, which is no joint before it")
    what = f"skeleton: joint {name}"
    rotations = _table(joint.get("rotations"), f"{what}: rotations")
    for unknown in set(rotations).difference(ARCHING_ROTATIONS):
        raise BadInput(f"{what}: no rotation {unknown!r}; {did_you_mean(unknown, ARCHING_ROTATIONS)}")
    weights = {each: _number(weight, f"{what}: weight of {each}") for each, weight in rotations.items()}
    offset_mm = _numbers(joint.get("offset"), 3, f"{what}: offset")
    orientation = _unit(joint.get("orientation"), 4, f"{what}: orientation")
    return Joint(name, parent, offset_mm, orientation, _unit(joint.get("axis"), 3, f"{what}: axis"), weights)


def _tip(item: Any, joints: Sequence[str]) -> Tip:
    tip = _table(item, "skeleton: tip")
    finger = next((key for key, name in FINGERS.items() if name == tip.get("finger")), None)
    if finger is None or tip.get("joint") not in joints:
        raise BadInput(
            f"skeleton: tip of {_shown(tip.get('finger'))} on {_shown(tip.get('joint'))}; expected one of "
            f"{', '.join(FINGERS.values())}, on a joint of the skeleton"
        )
    return Tip(finger, tip["joint"], _numbers(tip.get("offset"), 3, f"skeleton: tip of {FINGERS[finger]}"))


def _table(value: Any, what: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise BadInput(f"{what} is {_shown(value)}, expected a JSON object")
    return value


def _list(table: Mapping[str, Any], key: str) -> list[Any]:
    value = table.get(key)
    if not isinstance(value, list):
        raise BadInput(f"skeleton: {key} is {_shown(value)}, expected a list")
    return value


def _number(value: Any, what: str, least: float = -_MOST_MM) -> float:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not least <= value <= _MOST_MM:
        raise BadInput(f"{what} is {_shown(value)}, expected a number from {least:g} to {_MOST_MM:g}")
    return float(value)


def _numbers(value: Any, count: int, what: str) -> Any:
    if not isinstance(value, list) or len(value) != count:
        raise BadInput(f"{what} is {_shown(value)}, expected {count} numbers")
    return tuple(_number(each, what) for each in value)


def _unit(value: Any, count: int, what: str) -> Any:
    vector = _numbers(value, count, what)
    if abs(math.hypot(*vector) - 1.0) > _OFF_UNIT:
        raise BadInput(f"{what} has length {math.hypot(*vector):g}, expected 1")
    return vector


def _shown(value: Any) -> str:
    """Of a value that somebody sent, so much that it is recognised."""
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
