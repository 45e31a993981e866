"""What a motion is shown by instead of the hand itself: a character of an animation tool, or a robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.retargeting.robot_description import KINDS, RobotDescription
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.names import did_you_mean
from glovecal_service.exports.character_files import read_character
from glovecal_service.exports.hand_motion import Content, HandMotion
from glovecal_service.exports.robot_motion import Robot

_URDF = b"<robot"
_LOOKED_AT = 4096
"""Bytes of a file in which a URDF says what it is."""


class Shown(Protocol):
    """One hand, and another that shows what it does. Joints are (N, F, K + 1, 3) mm of each finger and its
    tip, from the wrist, in the hand's size."""

    @property
    def fingers(self) -> Sequence[str]: ...

    @property
    def palm(self) -> np.ndarray:
        """(3, 3) axes of the hand in which joints are told."""
        ...

    @property
    def skeleton(self) -> Skeleton: ...

    @property
    def mapping(self) -> Mapping[str, str]:
        """The other's bone by the hand's."""
        ...

    @property
    def choices(self) -> Sequence[str]:
        """Names of bones that others could be."""
        ...

    def own_joints_mm(self, angles_deg: np.ndarray) -> np.ndarray: ...

    def shown_joints_mm(self, angles_deg: np.ndarray) -> np.ndarray: ...


class Onto(Protocol):
    """``bones``, by the hand's (``bones_of``): where another is meant than is found; "": none."""

    def shown(self, skeleton: Skeleton, bones: Mapping[str, str]) -> Shown:
        """Raises BadInput where it has no such hand."""
        ...

    def write(
        self, motions: Sequence[HandMotion], content: Content, path: Path, bones: Mapping[str, str]
    ) -> None:
        """Hands on one time. Raises BadInput as ``shown``, and for a format that cannot hold it."""
        ...


def is_robot(onto: Path | str) -> bool:
    """``onto``: a file, or the name of a robot hand that comes with Glovecal."""
    if isinstance(onto, str):
        return True
    with onto.open("rb") as stream:
        return _URDF in stream.read(_LOOKED_AT)


def read_onto(onto: Path | str) -> Onto:
    """Raises BadInput for a robot that is not known and a file that is neither."""
    if isinstance(onto, str):
        if onto not in KINDS:
            raise BadInput(f"no robot hand {onto!r} comes with Glovecal; {did_you_mean(onto, KINDS)}")
        return Robot(RobotDescription(onto))
    if is_robot(onto):
        return Robot(RobotDescription.read(onto, "the robot's file"))
    return read_character(onto, "the character's file")
