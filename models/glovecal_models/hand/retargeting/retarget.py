"""Turns of another skeleton's bones that show what a hand does, made from both rest poses.

Angles are not copied: a rig's rest pose has fingers that are bent and spread, and axes of its own. Each bone
of the rig is fastened once to the anatomy of its segment (direction and back of the finger, from where its
bones lie), and then carried by the segment as the glove's kinematics turns it. So a straight finger is
straight on every rig, and what the hand points at, the rig points at.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.bones import HAND, METACARPAL, PHALANGES, HandBones
from glovecal_models.hand.retargeting.rig import Rig, hand_of
from glovecal_models.hand.rotations import VIRTUAL_SHARES
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.names import did_you_mean

_THUMB = f"thumb_{METACARPAL}"
LEAST_BACK = 0.3
"""Of the back of the hand seen across a finger: below, the finger points out of the palm, and its back is on
the side of its tip."""
THUMB_SEARCHED_DEG = 91
"""Steps of the search for the thumb's pose, one a degree."""


@dataclass(frozen=True)
class Retargeting:
    """From one hand to one rig. ``of`` makes it."""

    bones: HandBones
    rig: Rig
    names: tuple[str, ...]
    """The rig's bones that turn, parents before children."""
    segments: tuple[int, ...]
    """Of each, the hand's bone that carries it."""
    palm: np.ndarray
    """(3, 3) axes of the hand's frame in the rig's world, in its rest pose."""
    fastened: np.ndarray
    """(M, 3, 3) of each of ``names``: its orientation seen from its segment."""

    @classmethod
    def of(cls, skeleton: Skeleton, rig: Rig, mapping: Mapping[str, str] | None = None) -> Retargeting:
        """``mapping``: the rig's bone by the hand's; by default ``hand_of`` finds it. Raises BadInput for a
        bone that is not there and for a rest pose from which no palm can be made."""
        mapping = hand_of(rig, skeleton.hand) if mapping is None else dict(mapping)
        bones = HandBones.of(skeleton)
        for own, other in mapping.items():
            if own not in bones.names:
                raise BadInput(f"a hand has no bone {own!r}; {did_you_mean(own, bones.names)}")
            if other not in rig.by_name:
                raise BadInput(f"the rig has no bone {other!r}, which is to be {own}")
        if HAND not in mapping:
            raise BadInput("the bone of the hand itself is missing; say which it is")
        palm = _palm(rig, mapping, skeleton.hand == "left")
        order = {bone.name: number for number, bone in enumerate(rig.bones)}
        own_names = sorted(mapping, key=lambda name: order[mapping[name]])
        segments = [bones.names.index(name) for name in own_names]
        at_rest = [_segment_at_rest(bones, rig, mapping, palm, name) for name in own_names]
        fastened = [
            frame.T @ rig.by_name[mapping[name]].orientation
            for name, frame in zip(own_names, at_rest, strict=True)
        ]
        names = tuple(mapping[name] for name in own_names)
        return cls(bones, rig, names, tuple(segments), palm, np.array(fastened))

    def orientations(self, angles_deg: np.ndarray) -> np.ndarray:
        """(N, M, 3, 3) of the rig's bones ``names`` in its world, the forearm as in the rest pose; of
        ``angles_deg`` (N, R) in the order of the skeleton's rotations."""
        return self.carried(self.bones.orientations(angles_deg))

    def carried(self, segments: np.ndarray) -> np.ndarray:
        """As ``orientations``, of what ``HandBones.orientations`` gave."""
        return self.palm @ segments[:, list(self.segments)] @ self.fastened

    def against_parents(self, orientations: np.ndarray) -> np.ndarray:
        """(N, M, 3, 3) each seen from its parent bone, as tools with a hierarchy want it; bones between two
        of ``names`` keep what the rest pose has."""
        turned = orientations.copy()
        for number, (carrier, between) in enumerate(self._carriers):
            if carrier is None:
                turned[:, number] = between.T @ orientations[:, number]
            else:
                turned[:, number] = (orientations[:, carrier] @ between).swapaxes(1, 2) @ orientations[
                    :, number
                ]
        return turned

    def from_rest(self, against_parents: np.ndarray) -> np.ndarray:
        """(N, M, 3, 3) the turn from each bone's rest pose, in its own axes: what Blender calls a pose bone's
        rotation."""
        return self._rests.swapaxes(1, 2) @ against_parents

    @cached_property
    def mapping(self) -> dict[str, str]:
        """The rig's bone by the hand's."""
        own = (self.bones.names[segment] for segment in self.segments)
        return dict(zip(own, self.names, strict=True))

    @cached_property
    def _rests(self) -> np.ndarray:
        """(M, 3, 3) of each bone against its parent in the rest pose."""
        rests = []
        for name in self.names:
            bone = self.rig.by_name[name]
            parent = self.rig.by_name.get(bone.parent or "")
            rests.append(bone.orientation if parent is None else parent.orientation.T @ bone.orientation)
        return np.array(rests)

    @cached_property
    def _carriers(self) -> list[tuple[int | None, np.ndarray]]:
        """Of each bone the next above it that turns, and what stands between that one and its parent; where
        none turns, the parent's orientation in the rest pose."""
        carriers: list[tuple[int | None, np.ndarray]] = []
        for name in self.names:
            parent = self.rig.by_name.get(self.rig.by_name[name].parent or "")
            above = parent
            while above is not None and above.name not in self.names:
                above = self.rig.by_name.get(above.parent or "")
            own = np.eye(3) if parent is None else parent.orientation
            if above is None:
                carriers.append((None, own))
            else:
                carriers.append((self.names.index(above.name), above.orientation.T @ own))
        return carriers


def _palm(rig: Rig, mapping: Mapping[str, str], is_left: bool) -> np.ndarray:
    """(3, 3): x from the wrist to the middle knuckle, z out of the back of the hand."""
    wrist = np.array(rig.by_name[mapping[HAND]].head)
    knuckles = {
        finger: np.array(rig.by_name[mapping[f"{finger}_{parts[0]}"]].head)
        for finger, parts in PHALANGES.items()
        if finger != "thumb" and f"{finger}_{parts[0]}" in mapping
    }
    order = [finger for finger in ("index", "middle", "ring", "pinky") if finger in knuckles]
    if len(order) < 2:
        raise BadInput("the knuckles of two fingers are needed to see where the back of the hand is")
    middle = knuckles.get("middle", knuckles[order[0]])
    along = _unit(middle - wrist, "from the wrist to the middle finger's knuckle")
    across = knuckles[order[0]] - knuckles[order[-1]]
    across = _unit(
        across - along * (across @ along), "from the little finger's knuckle to the index finger's"
    )
    across = -across if is_left else across
    return np.column_stack([along, across, np.cross(along, across)])


def _segment_at_rest(
    bones: HandBones, rig: Rig, mapping: Mapping[str, str], palm: np.ndarray, name: str
) -> np.ndarray:
    """(3, 3) the frame that the segment has in the rig's rest pose, if its hand is taken for a hand."""
    if name == HAND:
        return palm
    finger = name.partition("_")[0]
    straight = palm @ bones.straight[bones.names.index(name)]
    along = direction(rig, mapping, name)
    if along is None:
        return straight
    if finger == "thumb":
        straight = palm @ _thumb_towards(bones, palm.T @ _first(rig, mapping, along))[name]
        return _swung(straight, along)
    back = palm[:, 2] - along * (along @ palm[:, 2])
    if np.linalg.norm(back) < LEAST_BACK:
        back = -palm[:, 0] + along * (along @ palm[:, 0])
    back = _unit(back, f"of {name}'s back")
    return np.column_stack([along, np.cross(back, along), back])


def _first(rig: Rig, mapping: Mapping[str, str], otherwise: np.ndarray) -> np.ndarray:
    along = direction(rig, mapping, _THUMB) if _THUMB in mapping else None
    return otherwise if along is None else along


def direction(rig: Rig, mapping: Mapping[str, str], name: str) -> np.ndarray | None:
    """(3,) along a bone: to the next of its finger, else to its end; None where nothing tells."""
    finger, _, part = name.partition("_")
    parts = PHALANGES[finger]
    head = np.array(rig.by_name[mapping[name]].head)
    following = parts[parts.index(part) + 1 :] if part in parts else parts[:1]
    after = next((mapping[f"{finger}_{each}"] for each in following if f"{finger}_{each}" in mapping), None)
    end = rig.end(mapping[name]) if after is None else np.array(rig.by_name[after].head)
    if end is None:  # a rig without fingertips: along the axis that the bone before lies along
        before = [f"{finger}_{each}" for each in parts[: parts.index(part)] if f"{finger}_{each}" in mapping]
        along = direction(rig, mapping, before[-1]) if before else None
        if along is None:
            return None
        return rig.by_name[mapping[name]].orientation @ rig.by_name[mapping[before[-1]]].orientation.T @ along
    length = np.linalg.norm(end - head)
    return None if length == 0 else (end - head) / length


def _thumb_towards(bones: HandBones, along: np.ndarray) -> dict[str, np.ndarray]:
    """Frames of the thumb's bones in the pose whose metacarpal points as near as can be to ``along`` (3,) of
    the hand's frame: how far its nail has turned follows from where it points."""
    skeleton = bones.skeleton
    across, away = np.meshgrid(np.arange(THUMB_SEARCHED_DEG), np.arange(THUMB_SEARCHED_DEG))
    rotations = list(skeleton.rotations)
    angles = np.zeros((across.size, len(rotations)))
    angles[:, rotations.index("T_TMC")] = across.reshape(-1) - 20.0
    angles[:, rotations.index("TI_ABD")] = away.reshape(-1) - 10.0
    for name, share in VIRTUAL_SHARES.items():
        angles[:, rotations.index("T_VIR")] += share * angles[:, rotations.index(name)]
    frames = bones.orientations(angles)
    base = bones.names.index(_THUMB)
    nearest = int(np.argmax(frames[:, base, :, 0] @ along))
    return {
        name: frames[nearest, number] for number, name in enumerate(bones.names) if name.startswith("thumb_")
    }


def _swung(frame: np.ndarray, along: np.ndarray) -> np.ndarray:
    """``frame`` (3, 3) turned the shortest way until its x points along ``along``."""
    axis = np.cross(frame[:, 0], along)
    cosine = float(frame[:, 0] @ along)
    if cosine < -0.999:
        raise BadInput("a bone of the rig's thumb points backwards; look at which bone is which")
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return (np.eye(3) + cross + cross @ cross / (1 + cosine)) @ frame


def _unit(vector: np.ndarray, which: str) -> np.ndarray:
    length = float(np.linalg.norm(vector))
    if not length > 0:
        raise BadInput(f"the rig's rest pose has no direction {which}; look at which bone is which")
    return vector / length
