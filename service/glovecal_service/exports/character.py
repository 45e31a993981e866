"""A character of an animation tool: its skeleton, and a take as its animation.

What is written is the character's own file with one animation more: meshes, materials and names stay.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.bones import HAND
from glovecal_models.hand.retargeting.bone_names import bones_of
from glovecal_models.hand.retargeting.retarget import Retargeting
from glovecal_models.hand.retargeting.rig import Rig, hand_of
from glovecal_models.hand.retargeting.touches import Touches
from glovecal_models.hand.skeleton import Skeleton
from glovecal_service.exports.body_motion import SIDES, whole_angles
from glovecal_service.exports.hand_motion import Content, HandMotion, blocks

MOST_LISTED = 20_000
"""Nodes of a scene."""
DEEPEST = 500
LONGEST_NAME = 200
LARGEST = 1e12
"""Of a matrix: what is larger is no place of a bone."""
FLATTEST = 1e-6
"""Of a matrix whose columns have the length one: the least singular value, below which it has no turn."""
NAME = "Glovecal take"
"""Of the animation."""


class Character(ABC):
    suffix: ClassVar[str]
    """Of its file, and of what is written."""

    @classmethod
    @abstractmethod
    def read(cls, path: Path, name: str) -> Character:
        """Raises BadInput that names ``name`` and what is wrong with it."""

    @cached_property
    @abstractmethod
    def rig(self) -> Rig:
        """At rest. Raises BadInput for what is no tree of bones."""

    def shown(self, skeleton: Skeleton, bones: Mapping[str, str]) -> Touches:
        """Raises BadInput where a hand is not found."""
        chosen = bones_of(bones, skeleton.hand)
        try:
            mapping = hand_of(self.rig, skeleton.hand)
        except BadInput:
            if not chosen:
                raise
            mapping = {}
        mapping = {own: name for own, name in (mapping | chosen).items() if name}
        return Touches(Retargeting.of(skeleton, self.rig, mapping))

    def write(
        self, motions: Sequence[HandMotion], content: Content, path: Path, bones: Mapping[str, str]
    ) -> None:
        """Hands on one time, as an animation more. Raises BadInput where a hand is not found, and for another
        format than the character's."""
        if path.suffix != self.suffix:
            raise BadInput(f"this character moves in a {self.suffix} file, not in {path.suffix}")
        for motion in motions:
            motion.require_angles(content)
        hands = [MovingHand(self.shown(one.skeleton, bones), whole_angles(one)) for one in motions]
        self.write_hands(motions, hands, path)

    @abstractmethod
    def write_hands(self, motions: Sequence[HandMotion], hands: Sequence[MovingHand], path: Path) -> None:
        """``hands``: each motion on its hand."""


@dataclass(frozen=True)
class MovingHand:
    """A motion on a character's hand."""

    touches: Touches
    angles_deg: np.ndarray
    """(N, R) finite."""

    @property
    def names(self) -> tuple[str, ...]:
        """Of the bones that turn."""
        return self.touches.retargeting.names

    @property
    def bone(self) -> str:
        """That is the whole hand."""
        return self.touches.retargeting.mapping[HAND]

    def turns(self) -> Iterator[tuple[slice, np.ndarray]]:
        """Frames of a block, and (n, M, 3, 3) of each of ``names`` against its parent."""
        for which, orientations in self.oriented():
            yield which, self.touches.retargeting.against_parents(orientations)

    def oriented(self) -> Iterator[tuple[slice, np.ndarray]]:
        """As ``turns``, in the rig's world."""
        for which in blocks(len(self.angles_deg)):
            yield which, self.touches.orientations(self.angles_deg[which])


def notes_of(motions: Sequence[HandMotion]) -> dict[str, Any]:
    """What an animation was made of, by hand."""
    notes: dict[str, Any] = {SIDES[motion.label].lower(): dict(motion.notes) for motion in motions}
    return notes | {"simulated": any(motion.simulated for motion in motions)}


def distinct(names: Iterable[str]) -> tuple[str, ...]:
    """Cut to a length, and each another: of one that is there already with its number."""
    made: list[str] = []
    taken: set[str] = set()
    for number, name in enumerate(names):
        short = name[:LONGEST_NAME] or f"node {number}"
        made.append(f"{short} ({number})" if short in taken else short)
        taken.add(made[-1])
    return tuple(made)


def axes_of(matrix: np.ndarray) -> np.ndarray:
    """(3, 3) the orientation in a matrix (4, 4) of place, turn and size, of a sheared one the nearest. Raises
    ValueError where there is none."""
    sizes = np.linalg.norm(matrix[:3, :3], axis=0)
    if not (np.abs(matrix) < LARGEST).all() or not sizes.all():
        raise ValueError("no place, or no size")
    left, strengths, right = np.linalg.svd(matrix[:3, :3] / sizes)
    if strengths[-1] < FLATTEST:
        raise ValueError("no turn")
    return left @ right
