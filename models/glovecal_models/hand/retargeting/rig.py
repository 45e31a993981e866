"""Another skeleton in its rest pose: where its bones are and how they stand, and which are a hand's.

Bones are found by their names, whatever the convention: a side (left, right, l, r), a finger (by its name, or
all five numbered from the thumb on), and either a number or the anatomical word. What a number means is not
trusted: some rigs count from the knuckle, others from the metacarpal, and some give the fingertip a bone. The
chain and where it begins tell.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.bones import HAND, PHALANGES
from glovecal_models.hand.rotations import Handedness

METACARPAL_UP_TO = 0.55
"""A finger's first bone is a metacarpal where it begins nearer to the wrist than this share of where its
second begins: a knuckle lies at 0.7 of the way to the middle joint, a metacarpal's base at 0.3."""
_SIDES: dict[str, Handedness] = {"left": "left", "l": "left", "right": "right", "r": "right"}
_FINGERS = {"thumb": "thumb", "index": "index", "middle": "middle", "mid": "middle", "ring": "ring",
            "pinky": "pinky", "little": "pinky", "pinkie": "pinky"}  # fmt: skip
_HANDS = ("hand", "wrist")
_TIPS = ("tip", "end", "nub")
_PALM = ("metacarpal", "palm", "carpal")
_HELPERS = ("twist", "ik", "pole", "weapon", "gun", "prop", "socket", "roll", "master", "mch", "org", "ctrl")
_NUMBERED = re.compile(r"(?:finger|digit)[ _.-]?(\d)", re.IGNORECASE)
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")


@dataclass(frozen=True)
class RigBone:
    name: str
    parent: str | None
    head: tuple[float, float, float]
    """Where it begins in the rest pose, in the rig's world, any unit."""
    orientation: np.ndarray
    """(3, 3) in the rest pose: columns are the bone's axes in the rig's world."""
    tail: tuple[float, float, float] | None = None
    """Where it ends, for a bone on which nothing hangs; None where the rig does not say it."""


@dataclass(frozen=True)
class Rig:
    """Bones of a right-handed world; what a left-handed tool says is mirrored on the way in and out."""

    bones: tuple[RigBone, ...]
    """Parents before children."""

    @cached_property
    def by_name(self) -> dict[str, RigBone]:
        return {bone.name: bone for bone in self.bones}

    def children(self, name: str) -> list[RigBone]:
        return [bone for bone in self.bones if bone.parent == name]

    def end(self, name: str) -> np.ndarray | None:
        """(3,) where a bone ends: at the one that goes on from it, else at its tail."""
        bone = self.by_name[name]
        if bone.tail is not None:
            return np.array(bone.tail)
        children = self.children(name)
        return np.array(children[0].head) if len(children) == 1 else None


@dataclass(frozen=True)
class _Named:
    """What a bone's name says."""

    bone: RigBone
    side: Handedness | None
    finger: str | None
    is_tip: bool
    is_hand: bool
    number: str | None = None
    """Of a finger that has no name."""


def _read(bone: RigBone) -> _Named | None:
    """None for what only helps an animator."""
    words = [word.lower() for word in _WORD.findall(bone.name)]
    if any(word in _HELPERS for word in words):
        return None
    side: Handedness | None = next((_SIDES[word] for word in words if word in _SIDES), None)
    finger = next((_FINGERS[word] for word in words if word in _FINGERS), None)
    numbered = _NUMBERED.search(bone.name) if finger is None else None
    return _Named(
        bone, side, finger, any(word in _TIPS for word in words),
        finger is None and numbered is None and any(word in _HANDS for word in words),
        None if numbered is None else numbered[1],
    )  # fmt: skip


def hand_of(rig: Rig, hand: Handedness) -> dict[str, str]:
    """Which of the rig's bones is which of a hand's, by the names of ``hand.bones``; what it lacks is left
    out. Raises BadInput where no hand of that side is there, or fewer than three fingers."""
    named = [each for each in map(_read, rig.bones) if each is not None]
    sides = {each.side for each in named if each.finger is not None or each.number is not None}
    own = _numbers_named(
        [each for each in named if each.side == hand or (sides == {None} and each.side is None)]
    )
    wrists = [each.bone for each in own if each.is_hand]
    chains = {finger: _chain(rig, [each for each in own if each.finger == finger]) for finger in PHALANGES}
    wrist = next((bone for bone in wrists if _carries(rig, bone, chains["middle"] or chains["index"])), None)
    if wrist is None:
        raise BadInput(
            f"no {hand} hand was found among {len(rig.bones)} bones ({_some(rig)}): a bone named hand or "
            "wrist that carries fingers; say which bone is which"
        )
    mapping = {HAND: wrist.name}
    for finger, chain in chains.items():
        parts = PHALANGES[finger]
        for part, bone in zip(parts, _phalanges(chain, wrist, finger), strict=False):
            mapping[f"{finger}_{part}"] = bone.name
    fingers = {name.partition("_")[0] for name in mapping} - {HAND}
    if len(fingers) < 3:
        raise BadInput(
            f"of the {hand} hand only {', '.join(sorted(fingers)) or 'the wrist'} was found ({_some(rig)}); "
            "say which bone is which"
        )
    return mapping


def _numbers_named(own: list[_Named]) -> list[_Named]:
    """Five numbers, from 0 or from 1 on, are the five fingers from the thumb on (3ds Max's Biped, Rokoko)."""
    numbers = sorted({each.number for each in own if each.number is not None})
    if len(numbers) != len(PHALANGES) or any(each.finger is not None for each in own):
        return own
    fingers = dict(zip(numbers, PHALANGES, strict=True))
    return [replace(each, finger=fingers.get(each.number or "")) for each in own]


def _chain(rig: Rig, bones: Iterable[_Named]) -> list[RigBone]:
    """The longest run of a finger's bones, each the next one's parent; without its tip's."""
    own = {each.bone.name: each for each in bones}
    best: list[RigBone] = []
    for each in own.values():
        run, bone = [], each.bone
        while bone is not None and bone.name in own:
            run.insert(0, bone)
            bone = rig.by_name.get(bone.parent or "")
        best = max(best, run, key=len)
    return [bone for bone in best if not own[bone.name].is_tip]


def _carries(rig: Rig, wrist: RigBone, chain: list[RigBone]) -> bool:
    bone = chain[0] if chain else None
    while bone is not None:
        if bone.name == wrist.name:
            return True
        bone = rig.by_name.get(bone.parent or "")
    return False


def _phalanges(chain: list[RigBone], wrist: RigBone, finger: str) -> list[RigBone]:
    """Three at most, from the first that turns."""
    if finger == "thumb" or len(chain) < 2:
        return chain[:3]
    first, second = (np.linalg.norm(np.subtract(bone.head, wrist.head)) for bone in chain[:2])
    named = any(word in chain[0].name.lower() for word in _PALM)
    begins_in_palm = named or first < METACARPAL_UP_TO * second
    return chain[1:4] if begins_in_palm else chain[:3]


def _some(rig: Rig) -> str:
    names = [bone.name for bone in rig.bones]
    return ", ".join(names[:5]) + (", ..." if len(names) > 5 else "")
