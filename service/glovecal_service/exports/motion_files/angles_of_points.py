"""Rotations of a hand from the places of its joints, as markers or another program's skeleton tell them.

A bend is the angle between two bones, wherever the hand is. What needs the palm (knuckles, spreads, wrist) is
told in its frame: x from the wrist to the middle knuckle, y to the thumb's side, z out of the back of the
hand. The thumb's own turns about its base are left out: no four points tell them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from glovecal_models.hand.rotations import FINGERS, Handedness

SIDES: dict[str, Handedness] = {"r": "right", "right": "right", "l": "left", "left": "left"}
WORDS_OF = {
    "T": ("thumb",), "I": ("index", "pointer"), "M": ("middle", "mid"), "R": ("ring",),
    "P": ("pinky", "pinkie", "little", "small"),
}  # fmt: skip
FINGER_OF = {word: finger for finger, words in WORDS_OF.items() for word in words}
CHAIN = {finger: ("CMC", "MCP", "IP", "TIP") if finger == "T" else ("MCP", "PIP", "DIP", "TIP")
         for finger in FINGERS}  # fmt: skip
"""Joints of a finger from its base on, in the order of their numbers."""
PLACE_OF = {
    "mcp": "MCP", "knuckle": "MCP", "pip": "PIP", "dip": "DIP", "ip": "IP", "cmc": "CMC", "tmc": "CMC",
    "metacarpal": "CMC", "proximal": "MCP", "intermediate": "PIP", "middle": "PIP", "distal": "DIP",
    "tip": "TIP", "end": "TIP",
}  # fmt: skip
MOST_BENT_FOR_A_SPREAD_DEG = 70.0
"""A finger that is bent further does not tell to which side it points."""


@dataclass(frozen=True)
class NamedPoint:
    """A place of a hand."""

    hand: Handedness | None
    """None where the name does not say it."""
    joint: str
    """Such as ``I_PIP``, ``T_TIP``, ``WRIST`` or ``ELBOW``."""


def named_points(names: Sequence[str]) -> dict[str, NamedPoint]:
    """What the names of markers or bones mean, such as ``R_index_pip``, ``RightHandIndex2`` or ``LThumb3``;
    those that mean nothing of a hand are left out."""
    words = {name: _words(name) for name in names}
    has_metacarpal_thumb = any("thumb" in each and "metacarpal" in each for each in words.values())
    points = {}
    for name, each in words.items():
        hands: list[Handedness] = [SIDES[word] for word in each if word in SIDES]
        joint = _joint([word for word in each if word not in SIDES], has_metacarpal_thumb)
        if joint:
            points[name] = NamedPoint(hands[0] if hands else None, joint)
    return points


def _words(name: str) -> list[str]:
    parts = re.sub(r"\b([RL])(?=[A-Z][a-z])", r"\1 ", name.rpartition(":")[2])
    return re.findall(r"[a-z]+|\d+", re.sub(r"([a-z])([A-Z])", r"\1 \2", parts).lower())


def _joint(words: Sequence[str], has_metacarpal_thumb: bool) -> str:
    at = next((index for index, word in enumerate(words) if word in FINGER_OF), None)
    if at is None:
        if "wrist" in words or list(words) == ["hand"]:
            return "WRIST"
        return "ELBOW" if "elbow" in words or list(words) in (["fore", "arm"], ["forearm"]) else ""
    finger, rest = FINGER_OF[words[at]], words[at + 1 :]
    place = next((PLACE_OF[word] for word in rest if word in PLACE_OF), "")
    numbers = [int(word) for word in rest if word.isdigit() and len(word) < 3]
    if not place and len(numbers) == 1 and 1 <= numbers[0] <= len(CHAIN[finger]):
        place = CHAIN[finger][numbers[0] - 1]
    if finger == "T":
        place = {"DIP": "IP", "PIP": "MCP"}.get(place, place)
        if "proximal" in rest and not has_metacarpal_thumb:
            place = "CMC"  # where no bone is called the metacarpal, it is the first of three
    elif place == "CMC":
        return ""
    return f"{finger}_{place}" if place in CHAIN[finger] else ""


@dataclass(frozen=True)
class HandAngles:
    """What places of a hand tell."""

    rotations: tuple[str, ...]
    degrees: np.ndarray
    """(N, len(rotations)); NaN where a place was not seen."""
    made_of: Mapping[str, tuple[str, ...]]
    """Joints whose places tell each rotation."""
    left_out: Mapping[str, str]
    """Rotations that these places do not tell, and why."""


def angles_of_points(places: Mapping[str, np.ndarray], hand: Handedness) -> HandAngles:
    """``places``: (N, 3) by joint, of one unit, NaN where it was not seen."""
    angles: dict[str, np.ndarray] = {}
    made_of: dict[str, tuple[str, ...]] = {}
    left_out: dict[str, str] = {}

    def tell(rotation: str, needed: Sequence[str], angle: Callable[..., np.ndarray]) -> None:
        missing = [name for name in needed if name not in places]
        if missing:
            left_out[rotation] = f"no point {', '.join(missing)}"
        else:
            angles[rotation], made_of[rotation] = angle(*(places[name] for name in needed)), tuple(needed)

    palm = _palm(places, hand)
    for finger in FINGERS:
        joints = [f"{finger}_{name}" for name in CHAIN[finger]]
        forwards = None if finger == "T" else palm
        for at in (1, 2):
            tell(joints[at], joints[at - 1 : at + 2], partial(_bend, forwards))
    if palm is None:
        left_out |= dict.fromkeys(NEED_A_PALM, "no points WRIST, and two knuckles, that tell the palm")
    else:
        for finger in "IMRP":
            tell(f"{finger}_MCP", (f"{finger}_MCP", f"{finger}_PIP"), partial(_flexion, palm))
        for rotation, towards, away in SPREADS:
            needed = [f"{each}_{joint}" for each in (towards, away) for joint in ("MCP", "PIP")]
            tell(rotation, needed, partial(_spread, palm))
        for rotation, turn in WRIST_TURNS.items():
            tell(rotation, ("ELBOW", "WRIST"), partial(turn, palm))
    moving = {name: values for name, values in angles.items() if np.isfinite(values).any()}
    left_out |= dict.fromkeys(set(angles) - set(moving), "its points are never seen together")
    count = len(next(iter(places.values()))) if places else 0
    degrees = np.column_stack(list(moving.values())) if moving else np.empty((count, 0))
    return HandAngles(tuple(moving), degrees, {name: made_of[name] for name in moving}, left_out)


def _wrist_flexion(palm: np.ndarray, elbow: np.ndarray, wrist: np.ndarray) -> np.ndarray:
    x, _, z = np.einsum("nij,nj->in", palm, wrist - elbow)
    return np.degrees(np.arctan2(z, x))


def _radial_deviation(palm: np.ndarray, elbow: np.ndarray, wrist: np.ndarray) -> np.ndarray:
    """The wrist turns to the side first, then it bends."""
    return np.degrees(np.arcsin(-np.einsum("nj,nj->n", palm[:, 1], _unit(wrist - elbow))))


SPREADS = (("IM_ABD", "I", "M"), ("MR_ABD", "M", "R"), ("RP_ABD", "R", "P"))
WRIST_TURNS = {"W_FLEX": _wrist_flexion, "W_ABD": _radial_deviation}
NEED_A_PALM = (*(f"{finger}_MCP" for finger in "IMRP"), *(name for name, *_ in SPREADS), *WRIST_TURNS)


def _unit(vectors: np.ndarray) -> np.ndarray:
    """NaN where there is no direction."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0, length, np.nan)


def _palm(places: Mapping[str, np.ndarray], hand: Handedness) -> np.ndarray | None:
    """(N, 3, 3): rows are the axes; None where the points that tell them are missing."""
    knuckles = [places[f"{finger}_MCP"] for finger in "IMRP" if f"{finger}_MCP" in places]
    if "WRIST" not in places or len(knuckles) < 2:
        return None
    ahead = places["M_MCP"] if "M_MCP" in places else np.mean(knuckles, axis=0)
    x = _unit(ahead - places["WRIST"])
    across = knuckles[0] - (places["R_MCP"] if "R_MCP" in places and len(knuckles) > 2 else knuckles[-1])
    y = _unit(across - (across * x).sum(axis=1, keepdims=True) * x)
    z = np.cross(x, y)
    return np.stack([x, y, -z if hand == "left" else z], axis=1)


def _flexion(palm: np.ndarray, base: np.ndarray, end: np.ndarray) -> np.ndarray:
    x, y, z = np.einsum("nij,nj->in", palm, end - base)
    return np.degrees(np.arctan2(-z, np.hypot(x, y) * np.where(x < 0, -1.0, 1.0)))


def _side(palm: np.ndarray, base: np.ndarray, end: np.ndarray) -> np.ndarray:
    """To the thumb's side of the middle metacarpal."""
    x, y, _ = np.einsum("nij,nj->in", palm, end - base)
    bent = np.abs(_flexion(palm, base, end)) > MOST_BENT_FOR_A_SPREAD_DEG
    return np.where(bent, np.nan, np.degrees(np.arctan2(y, x)))


def _spread(
    palm: np.ndarray, base: np.ndarray, end: np.ndarray, other_base: np.ndarray, other_end: np.ndarray
) -> np.ndarray:
    return _side(palm, base, end) - _side(palm, other_base, other_end)


def _bend(palm: np.ndarray | None, first: np.ndarray, middle: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Between two bones. Where the palm is known a finger that bends backwards has a negative one."""
    one, other = _unit(middle - first), _unit(last - middle)
    across = np.cross(one, other)
    size, along = np.linalg.norm(across, axis=1), (one * other).sum(axis=1)
    if palm is None:
        return np.degrees(np.arctan2(size, along))
    side = palm[:, 1] - (palm[:, 1] * one).sum(axis=1, keepdims=True) * one
    handed = np.sign(np.linalg.det(np.nan_to_num(palm, nan=1.0)))  # a left hand's frame is a mirror image
    backwards = (across * side).sum(axis=1) * np.where(handed < 0, -1.0, 1.0) < 0
    return np.degrees(np.arctan2(np.where(backwards, -size, size), along))
