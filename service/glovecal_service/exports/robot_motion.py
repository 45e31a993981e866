"""A take as joint angles of a robot's hand: of one that comes with Glovecal, or of any by its URDF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.retargeting.bone_names import bones_of
from glovecal_models.hand.retargeting.robot import LARGEST_URDF, RobotHand, known_robots, urdf_of
from glovecal_models.hand.retargeting.robot_retarget import RobotRetargeting
from glovecal_models.hand.skeleton import Skeleton
from glovecal_service.exports.body_motion import whole_angles
from glovecal_service.exports.formats import format_of
from glovecal_service.exports.hand_motion import Content, HandMotion, blocks

SUFFIXES = (".csv", ".parquet", ".mcap")
"""Of formats in which angles have the names of joints."""
KINDS = tuple(sorted({name.rpartition("_")[0] for name in known_robots()}))
"""Robot hands that come with Glovecal."""


@dataclass(frozen=True)
class Robot:
    kind: str
    """One of ``KINDS``, or the name of the file."""
    urdf: str | None = None
    """Its text, where it is a file's."""

    @classmethod
    def read(cls, path: Path, name: str) -> Robot:
        """Raises BadInput for a file that is too large, or no text."""
        if path.stat().st_size > LARGEST_URDF:
            raise BadInput(
                f"{name} has {path.stat().st_size} bytes; a robot's URDF has {LARGEST_URDF} at most"
            )
        try:
            return cls(name, path.read_text("utf-8"))
        except UnicodeDecodeError as error:
            raise BadInput(f"{name} is no text; give a robot's URDF, or a character (.glb)") from error

    def shown(self, skeleton: Skeleton, bones: Mapping[str, str]) -> RobotRetargeting:
        """Raises BadInput where the robot has no such hand."""
        name = self.kind if self.urdf is not None else f"{self.kind}_{skeleton.hand}"
        text = urdf_of(name) if self.urdf is None else self.urdf
        return RobotRetargeting(skeleton, RobotHand.from_urdf(text, name, bones_of(bones, skeleton.hand)))

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
            flags=None, notes={**motion.notes, "robot": self.kind},
        )  # fmt: skip
