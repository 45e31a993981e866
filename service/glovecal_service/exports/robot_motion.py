"""A take as joint angles of a robot's hand: of one that comes with Glovecal, or of any by its URDF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.retargeting.robot_description import RobotDescription
from glovecal_models.hand.retargeting.robot_retarget import RobotRetargeting
from glovecal_models.hand.skeleton import Skeleton
from glovecal_service.exports.body_motion import whole_angles
from glovecal_service.exports.formats import format_of
from glovecal_service.exports.hand_motion import Content, HandMotion, blocks

SUFFIXES = (".csv", ".parquet", ".mcap")
"""Of formats in which angles have the names of joints."""


@dataclass(frozen=True)
class Robot:
    description: RobotDescription

    def shown(self, skeleton: Skeleton, bones: Mapping[str, str]) -> RobotRetargeting:
        """Raises BadInput where the robot has no such hand."""
        return RobotRetargeting(skeleton, self.description.hand(skeleton.hand, bones))

    def write(
        self, motions: Sequence[HandMotion], content: Content, path: Path, bones: Mapping[str, str]
    ) -> None:
        """Angles of its joints. Raises BadInput where it has no such hand, and for a format without angles by
        name."""
        if path.suffix not in SUFFIXES:
            raise BadInput(f"a robot's joints are written as {', '.join(SUFFIXES)}, not as {path.suffix}")
        moved = [self._moved(motion, self.shown(motion.skeleton, bones)) for motion in motions]
        format_of(path.name).write(moved, "angles", path)

    def _moved(self, motion: HandMotion, shown: RobotRetargeting) -> HandMotion:
        """Where nothing is known of the hand, nothing is said of the robot."""
        motion.require_angles("angles")
        angles = whole_angles(motion)
        degrees = np.concatenate([np.degrees(shown.radians(angles[which])) for which in blocks(len(angles))])
        degrees[np.isnan(motion.degrees).all(axis=1)] = np.nan
        return replace(
            motion, rotations=shown.robot.free, degrees=degrees, sd_deg=np.full_like(degrees, np.nan),
            flags=None, notes={**motion.notes, "robot": self.description.name},
        )  # fmt: skip
