"""Hands in motion on a body at rest: what every format with a skeleton writes.

Lengths are millimetres, x to the body's left, y up, z forward. With no bone turned the body stands with its
arms out to the sides, palms down, fingers straight, and each bone's frame is parallel to the body's; only the
hands move. An angle that is not known stays as it last was.

Krnoul et al. 2016 (section 3.3.2) map the gloves onto the skeleton of a whole character, so that the same
model takes motion capture of the body and can be retargeted. Segment lengths are shares of stature (Drillis &
Contini 1966, as in Winter, "Biomechanics and Motor Control of Human Movement"); the stature follows from the
hand's length.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.bones import HAND, PHALANGES, HandBones
from glovecal_models.hand.rotations import WRIST, completed
from glovecal_models.hand.skeleton import Skeleton, hand_skeleton
from glovecal_service.exports.hand_motion import Content, HandMotion, blocks

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
SKELETAL: tuple[Content, ...] = ("joints", "angles")
"""What a skeleton in motion is of: both are its bones' turns."""
BODY_AXES = "x to the body's left, y up, z forward (right-handed)"
END = "_End"
SIMULATED = "SimulatedGlove"
"""A bone without length that marks what no person did, for formats without comments."""


def with_ends(bones: Sequence[Bone]) -> list[Bone]:
    """The bones, then the ends of those on which nothing hangs, as bones: there fingertips are."""
    ends = [bone for bone in bones if bone.end_mm is not None and any(bone.end_mm)]
    return [*bones, *(Bone(bone.name + END, bone.name, bone.end_mm or (0.0, 0.0, 0.0)) for bone in ends)]


def heads_mm(bones: Sequence[Bone]) -> dict[str, np.ndarray]:
    """(3,) where each bone begins in the body's frame when nothing is turned."""
    places: dict[str, np.ndarray] = {}
    for bone in bones:
        offset = np.array(bone.offset_mm)
        places[bone.name] = offset if bone.parent is None else places[bone.parent] + offset
    return places


def drawn_bones(bones: Sequence[Bone]) -> tuple[np.ndarray, np.ndarray, list[int]]:
    """Octahedra from each bone's head to where the next begins, so that a viewer shows the skeleton: corners
    (V, 3) mm with nothing turned, triangles (F, 3), and the bone, by its number, that carries each corner."""
    corners, faces, carriers = [], [], []
    heads, names = heads_mm(bones), [bone.name for bone in bones]
    for bone in bones:
        if bone.parent is not None and any(bone.offset_mm):
            faces.append(_TRIANGLES + len(carriers))
            corners.append(heads[bone.parent] + _octahedron(np.array(bone.offset_mm)))
            carriers += [names.index(bone.parent)] * len(corners[-1])
    return np.concatenate(corners), np.concatenate(faces), carriers


_TRIANGLES = np.array(
    [(0, 2, 1), (0, 3, 2), (0, 4, 3), (0, 1, 4), (5, 1, 2), (5, 2, 3), (5, 3, 4), (5, 4, 1)]
)
_THICKNESS, _WIDEST_AT = 0.12, 0.15
"""Of a bone as it is drawn, in its lengths."""


def _octahedron(along: np.ndarray) -> np.ndarray:
    """(6, 3) corners of a bone that begins at the origin: its head, four around it, its tail."""
    length = np.linalg.norm(along)
    side = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    side *= _THICKNESS / 2 * length / np.linalg.norm(side)
    other = np.cross(along / length, side)
    around = [_WIDEST_AT * along + corner for corner in (side, other, -side, -other)]
    return np.array([np.zeros(3), *around, along])


@dataclass(frozen=True)
class BodyMotion:
    """N frames of a body whose hands move."""

    bones: tuple[Bone, ...]
    """Parents before children; the first is the root."""
    time_s: np.ndarray
    """(N,), of the recording's clock."""
    hands: tuple[_Hand, ...]
    motions: tuple[HandMotion, ...]
    """What the hands that move were made of."""
    notes: Mapping[str, Any]
    """What it was made of and how, by hand, and whether any of it was simulated."""

    @classmethod
    def of(cls, motions: Sequence[HandMotion], content: Content, suffix: str) -> BodyMotion:
        """Of hands on one time; a hand that was not recorded is at rest. Raises BadInput, which names the
        format by its ``suffix``, where nothing is calibrated and for hands that were placed by markers."""
        for motion in motions:
            motion.require_angles(content)
            if motion.frame is not None:
                raise BadInput(f"{suffix} puts hands on a body at rest; hands placed by markers go into .trc")
        time_s = motions[0].time_s
        hands = {motion.label: _Hand.moving(motion) for motion in motions}
        length = float(np.mean([motion.skeleton.dimensions.hand_length_mm for motion in motions]))
        for label in SIDES:
            if label not in hands:
                hands[label] = _Hand.at_rest(motions[0].skeleton, label)
        bones = body_at_rest(length)
        for label, hand in hands.items():
            bones += hand.bones_at_rest(wrist_offset_mm(length, label))
        simulated = any(motion.simulated for motion in motions)
        if simulated:
            bones.append(Bone(SIMULATED, ROOT, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
        notes = {"simulated": simulated} | {
            SIDES[motion.label].lower(): dict(motion.notes) for motion in motions
        }
        return cls(tuple(bones), time_s, tuple(hands.values()), tuple(motions), notes)

    @property
    def moving(self) -> tuple[str, ...]:
        """Names of the bones that turn, in the order of ``turns``."""
        return tuple(name for hand in self.hands if hand.degrees is not None for name in hand.bone_names)

    @property
    def by_hand_bone(self) -> Mapping[str, HandMotion]:
        """What moves, by the bone that is the whole hand."""
        return {f"{SIDES[motion.label]}Hand": motion for motion in self.motions}

    def turns(self) -> Iterator[tuple[slice, np.ndarray]]:
        """Frames of a block, and (n, B, 3, 3) how each of ``moving`` is turned against its parent."""
        for which in blocks(len(self.time_s)):
            yield (
                which,
                np.concatenate([hand.turns(which) for hand in self.hands if hand.degrees is not None], 1),
            )


@dataclass(frozen=True)
class _Hand:
    label: str
    bones: HandBones
    degrees: np.ndarray | None
    """(N, R) in the skeleton's order, finite; None for a hand at rest."""

    @classmethod
    def moving(cls, motion: HandMotion) -> _Hand:
        return cls(motion.label, HandBones.of(motion.skeleton), whole_angles(motion))

    @classmethod
    def at_rest(cls, other: Skeleton, label: str) -> _Hand:
        """Of the other hand's dimensions."""
        skeleton = hand_skeleton(other.dimensions, "left" if label == "L" else "right")
        return cls(label, HandBones.of(skeleton), None)

    @property
    def bone_names(self) -> list[str]:
        return [_name(name, SIDES[self.label]) for name in self.bones.names]

    def bones_at_rest(self, wrist_mm: tuple[float, float, float]) -> list[Bone]:
        """From the wrist to the fingertips."""
        to_body, straight, names = PALM_DOWN[self.label], self.bones.straight, self.bone_names
        found = []
        for bone, parent in enumerate(self.bones.parents):
            if parent is None:
                offset, carrier = wrist_mm, f"{SIDES[self.label]}ForeArm"
            else:
                offset = _vector(to_body @ straight[parent] @ self.bones.heads_mm[bone])
                carrier = names[parent]
            ends = bone not in self.bones.parents
            tail = _vector(to_body @ straight[bone] @ self.bones.tails_mm[bone]) if ends else None
            found.append(Bone(names[bone], carrier, offset, tail))
        return found

    def turns(self, which: slice) -> np.ndarray:
        """(n, B, 3, 3) of each bone against its parent, in the body's axes."""
        assert self.degrees is not None
        to_body = PALM_DOWN[self.label]
        own = self.bones.orientations(self.degrees[which])
        from_straight = to_body @ own @ self.bones.straight.swapaxes(1, 2) @ to_body.T
        against = from_straight.copy()
        for bone, parent in enumerate(self.bones.parents):
            if parent is not None:
                against[:, bone] = from_straight[:, parent].swapaxes(1, 2) @ from_straight[:, bone]
        return against


def continuous_quaternions(
    blocks_of_turns: Iterable[tuple[slice, np.ndarray]],
) -> Iterator[tuple[slice, np.ndarray]]:
    """Frames of a block, and (n, B, 4) its turns (n, B, 3, 3) as x, y, z, w; of a turn's two quaternions the
    one nearer to that of the frame before, so that what stands between two key frames is between them."""
    from scipy.spatial.transform import Rotation  # slow to load, and every command that exports loads this

    last = None
    for which, turns in blocks_of_turns:
        quaternions = Rotation.from_matrix(turns.reshape(-1, 3, 3)).as_quat()
        quaternions = quaternions.reshape(*turns.shape[:2], 4)
        before = np.concatenate([quaternions[:1] if last is None else last, quaternions[:-1]])
        quaternions *= np.cumprod(np.where((quaternions * before).sum(axis=2) < 0, -1.0, 1.0), axis=0)[
            :, :, None
        ]
        last = quaternions[-1:]
        yield which, quaternions


def _name(bone: str, side: str) -> str:
    """As common rigs call it: Index1 to Index3 from the knuckle on; the palm's joint InHandPinky."""
    if bone == HAND:
        return f"{side}Hand"
    finger, _, part = bone.partition("_")
    phalanges = PHALANGES[finger]
    if part not in phalanges:
        return f"{side}InHand{finger.capitalize()}"
    return f"{side}Hand{finger.capitalize()}{phalanges.index(part) + 1}"


def even_steps(time_s: np.ndarray, digits: int) -> tuple[np.ndarray, float]:
    """Times on even steps from the first to the last, and the step in seconds, rounded to ``digits`` as it is
    written, or frames run away from it. Raises BadInput for one frame, and for too many."""
    if len(time_s) < 2:
        raise BadInput(f"{len(time_s)} frames are no motion; give two or more")
    lasts = float(time_s[-1] - time_s[0])
    count = round(lasts / float(np.median(np.diff(time_s)))) + 1
    if count > MOST_FRAMES:
        raise BadInput(f"{count} frames on even steps are too many; at most {MOST_FRAMES}")
    step = round(lasts / (count - 1), digits)
    return np.minimum(time_s[0] + step * np.arange(count), time_s[-1]), step


def whole_angles(motion: HandMotion) -> np.ndarray:
    """(N, R) in the order of the skeleton's rotations, finite: an angle that is not known stays as it last
    was; what was never known follows a rule, or rests."""
    degrees = _held(motion.degrees)
    if motion.wrist == "optical":
        degrees[:, [name in WRIST for name in motion.rotations]] = 0.0
    return completed(motion.rotations, degrees, motion.skeleton.rotations)


def _held(degrees: np.ndarray) -> np.ndarray:
    """A copy in which a missing angle is the last known one; NaN before the first."""
    known = np.where(np.isfinite(degrees), np.arange(len(degrees))[:, None], -1)
    last = np.maximum.accumulate(known, axis=0)
    return np.where(last < 0, np.nan, np.take_along_axis(degrees, np.maximum(last, 0), axis=0))


def _vector(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
