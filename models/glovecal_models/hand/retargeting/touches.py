"""Touches kept: where the hand's thumb and a finger meet, those of a rig with other lengths meet too.

Bones that are turned alike end elsewhere where lengths differ. Near a touch the joints of thumb and finger
are turned a little further (damped least squares), the more the nearer the hand's own fingertips are, until
the rig's tips stand to each other as the hand's do, in the rig's size.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from glovecal_models.hand.bones import HAND, PHALANGES
from glovecal_models.hand.retargeting.retarget import Retargeting, direction
from glovecal_models.hand.retargeting.turns import cross, turn
from glovecal_models.hand.skeleton import Skeleton

FAR_MM, TOUCHING_MM = 35.0, 12.0
"""Between the hand's own fingertips: from where on joints are turned further, and where all of it is done."""
DAMPING = 0.015
"""Of joints that turn further, in lengths of the rig's hand a radian."""
STEPS = 4
"""Of Gauss and Newton: then what is left is below 1 % of what there was."""
LAST_SHARE = 0.75
"""Of the bone before: how long a finger's last bone is taken to be where the rig does not say it."""
_FLEX, _SPREAD = 1, 2
"""Axes of a segment about which its joint turns."""


def nearness(distance_mm: np.ndarray) -> np.ndarray:
    """0 for fingertips that are far from each other, 1 for those that touch."""
    return np.clip((FAR_MM - distance_mm) / (FAR_MM - TOUCHING_MM), 0.0, 1.0)


@dataclass(frozen=True)
class Chain:
    """One finger of the rig."""

    bones: tuple[int, ...]
    """Numbers in the retargeting's names."""
    base: np.ndarray
    """(3,) where the first begins, in the axes of the rig's hand bone, from its head."""
    offsets: np.ndarray
    """(K, 3) from each bone's head to the next one's, or to the tip, in the bone's own axes."""


@dataclass(frozen=True)
class Touches:
    """Keeps touches of one retargeting."""

    retargeting: Retargeting

    def orientations(self, angles_deg: np.ndarray) -> np.ndarray:
        """As ``Retargeting.orientations``, turned further where fingers touch the thumb."""
        bones = self.retargeting.bones
        segments, places = bones.posed(angles_deg)
        turned = self.retargeting.carried(segments)
        if "thumb" not in self.chains or len(self.chains) < 2:
            return turned
        tips = places[:, [bones.names.index(f"{finger}_distal") for finger in self.chains], 1]
        thumb = list(self.chains).index("thumb")
        gaps = np.delete(tips - tips[:, [thumb]], thumb, axis=1)
        distance = np.linalg.norm(gaps, axis=2)
        weights = nearness(distance)
        near = weights.any(axis=1)
        if near.any():
            wanted = self.units_a_mm * gaps[near] @ self.retargeting.palm.T
            turned[near] = self._turned(turned[near], thumb, wanted, weights[near])
        return turned

    def own_joints_mm(self, angles_deg: np.ndarray) -> np.ndarray:
        """(N, F, K + 1, 3) as ``joints``, of the hand itself, from its wrist, in the rig's world, mm."""
        bones = self.retargeting.bones
        places = bones.posed(angles_deg)[1] @ self.retargeting.palm.T
        numbers = np.array(
            [[bones.names.index(f"{finger}_{part}") for part in PHALANGES[finger]] for finger in self.chains]
        )
        return np.concatenate([places[:, numbers, 0], places[:, numbers[:, -1:], 1]], axis=2)

    def shown_joints_mm(self, angles_deg: np.ndarray) -> np.ndarray:
        """As ``own_joints_mm``, of the rig, in the hand's size."""
        return self.joints(self.orientations(angles_deg)) / self.units_a_mm

    @property
    def fingers(self) -> tuple[str, ...]:
        return tuple(self.chains)

    @property
    def palm(self) -> np.ndarray:
        """(3, 3) axes of the hand in the rig's world, in which joints are told."""
        return self.retargeting.palm

    @property
    def skeleton(self) -> Skeleton:
        return self.retargeting.bones.skeleton

    @property
    def mapping(self) -> dict[str, str]:
        """The rig's bone by the hand's."""
        return self.retargeting.mapping

    @property
    def choices(self) -> tuple[str, ...]:
        """Names of the rig's bones."""
        return tuple(bone.name for bone in self.retargeting.rig.bones)

    @cached_property
    def chains(self) -> dict[str, Chain]:
        """Fingers whose bones all turn."""
        made = self.retargeting
        mapping, rig = made.mapping, made.rig
        wrist = rig.by_name[mapping[HAND]]
        chains = {}
        for finger, parts in PHALANGES.items():
            own = [f"{finger}_{part}" for part in parts]
            if not all(name in mapping for name in own):
                continue
            bones = [rig.by_name[mapping[name]] for name in own]
            heads = [np.array(bone.head) for bone in bones]
            end = rig.end(bones[-1].name)
            if end is None:
                along = direction(rig, mapping, own[-1])
                length = 0.0 if along is None else LAST_SHARE * float(np.linalg.norm(heads[-1] - heads[-2]))
                end = heads[-1] if along is None else heads[-1] + length * along
            ends = [*heads[1:], end]
            offsets = [
                bone.orientation.T @ (after - head)
                for bone, head, after in zip(bones, heads, ends, strict=True)
            ]
            base = wrist.orientation.T @ (heads[0] - np.array(wrist.head))
            numbers = tuple(made.names.index(bone.name) for bone in bones)
            chains[finger] = Chain(numbers, base, np.array(offsets))
        return chains

    @cached_property
    def units_a_mm(self) -> float:
        """Units of the rig for a millimetre of the hand: by the lengths of their fingers, knuckle to tip."""
        bones = self.retargeting.bones
        own = other = 0.0
        for finger, chain in self.chains.items():
            numbers = [bones.names.index(f"{finger}_{part}") for part in PHALANGES[finger]]
            own += float(np.linalg.norm(bones.tails_mm[numbers], axis=1).sum())
            other += float(np.linalg.norm(chain.offsets, axis=1).sum())
        return other / own if own else 1.0

    @cached_property
    def _numbers(self) -> np.ndarray:
        """(F, K) the bones of the fingers, in the retargeting's names."""
        return np.array([chain.bones for chain in self.chains.values()])

    @cached_property
    def _bases(self) -> np.ndarray:
        return np.array([chain.base for chain in self.chains.values()])

    @cached_property
    def _offsets(self) -> np.ndarray:
        return np.array([chain.offsets for chain in self.chains.values()])

    def joints(self, orientations: np.ndarray) -> np.ndarray:
        """(N, F, K + 1, 3): joints of each finger and its tip, from the head of the hand bone."""
        made = self.retargeting
        wrist = orientations[:, made.names.index(made.mapping[HAND])]
        first = self._bases @ wrist.swapaxes(1, 2)
        steps = np.einsum("nfkij,fkj->nfki", orientations[:, self._numbers], self._offsets)
        return np.concatenate([first[:, :, None], first[:, :, None] + np.cumsum(steps, axis=2)], axis=2)

    def _turned(
        self, orientations: np.ndarray, thumb: int, wanted: np.ndarray, weights: np.ndarray
    ) -> np.ndarray:
        """``wanted`` (n, F - 1, 3) from the thumb's tip to each finger's, ``weights`` (n, F - 1)."""
        count, fingers = len(orientations), len(self.chains)
        size = self.units_a_mm * self.retargeting.bones.skeleton.dimensions.hand_length_mm
        others = [number for number in range(fingers) if number != thumb]
        places, axes = np.array(_JOINTS).T
        further = np.zeros((count, fingers * len(_JOINTS)))
        turned, aim = orientations.copy(), None
        fastened = self.retargeting.fastened[self._numbers].swapaxes(-1, -2)
        damped = DAMPING**2 * np.eye(further.shape[1])
        for _ in range(STEPS):
            joints = self.joints(turned)
            gaps = joints[:, others, -1] - joints[:, [thumb], -1]
            aim = gaps + weights[:, :, None] * (wanted - gaps) if aim is None else aim
            segments = turned[:, self._numbers] @ fastened
            about = segments[:, :, places, :, axes].transpose(1, 2, 0, 3)
            arms = joints[:, :, [-1]] - joints[:, :, places]
            moved = cross(about, arms) / size
            rows = np.zeros((count, len(others), 3, fingers, len(_JOINTS)))
            rows[:, :, :, thumb] = -moved[:, thumb].swapaxes(1, 2)[:, None]
            for row, finger in enumerate(others):
                rows[:, row, :, finger] = moved[:, finger].swapaxes(1, 2)
            rows = (weights[:, :, None, None, None] * rows).reshape(count, -1, further.shape[1])
            lacks = (weights[:, :, None] * (gaps - aim) / size).reshape(count, -1, 1)
            across = rows.swapaxes(1, 2)
            step = np.linalg.solve(across @ rows + damped, -across @ lacks - damped @ further[:, :, None])[
                :, :, 0
            ]
            further += step
            vectors = np.zeros((count, fingers, len(self._offsets[0]), 3))
            parts = step.reshape(count, fingers, -1, 1) * about
            for column, place in enumerate(places):
                vectors[:, :, place] += parts[:, :, column]
            turns = turn(vectors)
            for place in range(1, turns.shape[2]):
                turns[:, :, place] = turns[:, :, place - 1] @ turns[:, :, place]
            turned[:, self._numbers] = turns @ turned[:, self._numbers]
        return turned


_JOINTS = ((0, _FLEX), (0, _SPREAD), (1, _FLEX), (2, _FLEX))
"""Of each finger: which bone turns, about which of its segment's axes."""
