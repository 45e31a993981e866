"""BVH (Biovision hierarchy): calibrated hands on the skeleton of a whole body, as animation tools read it.

Lengths are centimetres, x to the body's left, y up, z forward. All rotations zero is the body with its arms
out to the sides, palms down, fingers straight; only the hands move. A file has one frame time: frames stand
on even steps, and an angle that is not known there stays as it last was.

Krnoul et al. 2016 (section 3.3.2) map the gloves onto the skeleton of a whole character, so that the same
model takes motion capture of the body and can be retargeted. Segment lengths are shares of stature (Drillis &
Contini 1966, as in Winter, "Biomechanics and Motor Control of Human Movement"); the stature follows from the
hand's length.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TextIO

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.rotations import FINGERS, WRIST, completed
from glovecal_models.hand.skeleton import Skeleton, hand_skeleton
from glovecal_service.exports.hand_motion import Content, ExportFormat, HandMotion, at_times, blocks

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


MOST_FRAMES = 1_000_000
MM_PER_UNIT = 10.0
STEP_DIGITS = 9
"""Of the frame time, seconds."""
ORDER = "ZXY"
"""Of a bone's three turns. The middle one, about the finger's length, stays far from 90 degrees."""
SIMULATED = "SimulatedGlove"
"""A bone without length that marks what no person did: the format has no comments."""


def write_bvh(motions: Sequence[HandMotion], content: Content, path: Path) -> None:
    """Hands on one time, on one body. Raises BadInput for raw readings, for one frame, and for too many."""
    if content == "raw":
        raise BadInput("BVH holds rotations of joints; raw readings go into .trc, .csv or .parquet")
    for motion in motions:
        motion.require_angles(content)
        if motion.frame is not None:
            raise BadInput("BVH puts hands on a body at rest; hands placed by markers go into .trc")
    time_s, step_s = _even_times(motions[0].time_s)
    hands = {motion.label: _Hand.moving(at_times(motion, time_s)) for motion in motions}
    length = float(np.mean([motion.skeleton.dimensions.hand_length_mm for motion in motions]))
    for label in SIDES:
        if label not in hands:
            hands[label] = _Hand.at_rest(motions[0].skeleton, label, len(time_s))
    bones = body_at_rest(length)
    for label, hand in hands.items():
        bones += hand.bones(label, wrist_offset_mm(length, label))
    if any(motion.simulated for motion in motions):
        bones.append(Bone(SIMULATED, ROOT, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    with path.open("w", encoding="ascii", newline="\n") as stream:
        order = _write_hierarchy(stream, bones)
        stream.write(f"MOTION\nFrames: {len(time_s)}\nFrame Time: {step_s:.{STEP_DIGITS}f}\n")
        root = next(bone for bone in bones if bone.parent is None)
        for which in blocks(len(time_s)):
            turns: dict[str, np.ndarray] = {}
            for label, hand in hands.items():
                turns |= replace(hand, degrees=hand.degrees[which]).turns(label)
            stream.writelines(_rows(root, order, turns, which.stop - which.start))


@dataclass(frozen=True)
class _Hand:
    skeleton: Skeleton
    degrees: np.ndarray
    """(N, R) in the skeleton's order, finite."""

    @classmethod
    def moving(cls, motion: HandMotion) -> _Hand:
        degrees = _held(motion.degrees)
        if motion.wrist == "optical":
            degrees[:, [name in WRIST for name in motion.rotations]] = 0.0
        return cls(motion.skeleton, completed(motion.rotations, degrees, motion.skeleton.rotations))

    @classmethod
    def at_rest(cls, other: Skeleton, label: str, count: int) -> _Hand:
        """Of the other hand's dimensions."""
        skeleton = hand_skeleton(other.dimensions, "left" if label == "L" else "right")
        return cls(skeleton, np.zeros((count, len(skeleton.rotations))))

    def bones(self, label: str, wrist_mm: tuple[float, float, float]) -> list[Bone]:
        """From the wrist to the fingertips."""
        to_body = PALM_DOWN[label]
        rest = self._rest()
        found = []
        tips = {tip.joint: tip.offset_mm for tip in self.skeleton.tips}
        for first, last in _places(self.skeleton):
            parent = self.skeleton.parents[first]
            offset, end = wrist_mm, None
            if parent is not None:
                offset = _vector(to_body @ rest[parent] @ self.skeleton.offsets_mm[first])
            if (tip := tips.get(self.skeleton.joints[last].name)) is not None:
                end = _vector(to_body @ rest[last] @ np.array(tip))
            found.append(Bone(self._name(last, label), self._parent(parent, label), offset, end))
        return found

    def turns(self, label: str) -> dict[str, np.ndarray]:
        """(N, 3, 3) of each bone against its parent, in the body's axes."""
        to_body, rest = PALM_DOWN[label], self._rest()
        frames = forward_kinematics(self.skeleton, self.degrees).orientations
        from_rest = to_body @ frames @ rest.swapaxes(1, 2) @ to_body.T
        found = {}
        for first, last in _places(self.skeleton):
            parent = self.skeleton.parents[first]
            own = from_rest[:, last]
            found[self._name(last, label)] = (
                own if parent is None else from_rest[:, parent].swapaxes(1, 2) @ own
            )
        return found

    def _rest(self) -> np.ndarray:
        """(J, 3, 3)."""
        return forward_kinematics(self.skeleton, np.zeros((1, len(self.skeleton.rotations)))).orientations[0]

    def _parent(self, joint: int | None, label: str) -> str:
        return f"{SIDES[label]}ForeArm" if joint is None else self._name(joint, label)

    def _name(self, joint: int, label: str) -> str:
        """As common rigs call it: Index1 to Index3 from the knuckle on; the palm's joint InHandPinky."""
        name = self.skeleton.joints[joint].name
        finger, _, part = name.partition("_")
        side = SIDES[label]
        if finger == "W":
            return f"{side}Hand"
        if name == "P_CMC":
            return f"{side}InHandPinky"
        numbers = {"T": ("VIR", "MCP", "IP")}.get(finger, ("MCP", "PIP", "DIP"))
        return f"{side}Hand{FINGERS[finger].capitalize()}{numbers.index(part) + 1}"


def _places(skeleton: Skeleton) -> Iterator[tuple[int, int]]:
    """First and last of the joints that lie in one place and turn one bone."""
    here = [not np.any(skeleton.offsets_mm[joint]) for joint in range(len(skeleton.joints))]
    for joint, parent in enumerate(skeleton.parents):
        if parent is not None and here[joint]:
            continue
        last = joint
        while last + 1 < len(here) and here[last + 1] and skeleton.parents[last + 1] == last:
            last += 1
        yield joint, last


def _even_times(time_s: np.ndarray) -> tuple[np.ndarray, float]:
    if len(time_s) < 2:
        raise BadInput(f"{len(time_s)} frames are no motion; BVH needs two or more")
    lasts = float(time_s[-1] - time_s[0])
    count = round(lasts / float(np.median(np.diff(time_s)))) + 1
    if count > MOST_FRAMES:
        raise BadInput(f"{count} frames on even steps are too many; at most {MOST_FRAMES}")
    step = round(lasts / (count - 1), STEP_DIGITS)  # as it is written, or frames run away from it
    return np.minimum(time_s[0] + step * np.arange(count), time_s[-1]), step


def _held(degrees: np.ndarray) -> np.ndarray:
    """A copy in which a missing angle is the last known one; NaN before the first."""
    known = np.where(np.isfinite(degrees), np.arange(len(degrees))[:, None], -1)
    last = np.maximum.accumulate(known, axis=0)
    return np.where(last < 0, np.nan, np.take_along_axis(degrees, np.maximum(last, 0), axis=0))


def _vector(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def _write_hierarchy(stream: TextIO, bones: Sequence[Bone]) -> list[str]:
    """The names of the bones in the order of their channels."""
    children: dict[str | None, list[Bone]] = {}
    for bone in bones:
        children.setdefault(bone.parent, []).append(bone)
    order: list[str] = []
    lines = ["HIERARCHY"]

    def offset(values: tuple[float, float, float]) -> str:
        return "OFFSET " + " ".join(f"{value / MM_PER_UNIT:.6f}" for value in values)

    def write(bone: Bone, depth: int) -> None:
        tab, is_root = "\t" * depth, bone.parent is None
        places = "Xposition Yposition Zposition " if is_root else ""
        count = 6 if is_root else 3
        rotations = " ".join(f"{axis}rotation" for axis in ORDER)
        order.append(bone.name)
        lines.extend([f"{tab}{'ROOT' if is_root else 'JOINT'} {bone.name}", f"{tab}{{"])
        # The root's place is in its channels, where readers differ in whether they add the offset to it.
        at = replace(bone, offset_mm=(0.0, 0.0, 0.0)) if is_root else bone
        lines.append(f"{tab}\t{offset(at.offset_mm)}")
        lines.append(f"{tab}\tCHANNELS {count} {places}{rotations}")
        for child in children.get(bone.name, []):
            write(child, depth + 1)
        if bone.end_mm is not None:
            lines.extend([f"{tab}\tEnd Site", f"{tab}\t{{", f"{tab}\t\t{offset(bone.end_mm)}", f"{tab}\t}}"])
        lines.append(f"{tab}}}")

    write(children[None][0], 0)
    stream.write("\n".join(lines) + "\n")
    return order


def _rows(root: Bone, order: Sequence[str], turns: Mapping[str, np.ndarray], count: int) -> Iterator[str]:
    """Lines of ``count`` frames; ``turns``: (count, 3, 3) by bone."""
    from scipy.spatial.transform import Rotation  # slow to load, and every command that exports loads this

    columns = [np.tile(np.array(root.offset_mm) / MM_PER_UNIT, (count, 1))]
    for name in order:
        found = turns.get(name)
        columns.append(
            np.zeros((count, 3))
            if found is None
            else Rotation.from_matrix(found).as_euler(ORDER, degrees=True)
        )
    for row in (np.concatenate(columns, axis=1) + 0.0).tolist():
        yield " ".join(f"{value:.6f}" for value in row) + "\n"


FORMAT = ExportFormat(".bvh", "application/octet-stream", write_bvh)
