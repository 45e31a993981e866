"""Which robot's hand is meant: one that comes with Glovecal, or one of a URDF file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from glovecal_models.errors import BadInput
from glovecal_models.hand.retargeting.bone_names import bones_of
from glovecal_models.hand.retargeting.robot import LARGEST_URDF, RobotHand, known_robots, urdf_of
from glovecal_models.hand.rotations import Handedness
from glovecal_models.names import did_you_mean

KINDS = tuple(sorted({name.rpartition("_")[0] for name in known_robots()}))
"""Robot hands that come with Glovecal."""


@dataclass(frozen=True)
class RobotDescription:
    name: str
    """One of ``KINDS``, or of the file."""
    urdf: str | None = None
    """Its text, where it is a file's."""

    @classmethod
    def named(cls, named: str) -> RobotDescription:
        """One of ``KINDS``, or a URDF file of this computer. Raises BadInput."""
        if named in KINDS:
            return cls(named)
        if Path(named).is_file():
            return cls.read(Path(named), named)
        raise BadInput(
            f"{named!r} is neither a URDF file nor a robot hand that comes with Glovecal; "
            f"{did_you_mean(named, KINDS)}"
        )

    @classmethod
    def read(cls, path: Path, name: str) -> RobotDescription:
        """Raises BadInput that names ``name`` for a file that is too large, or no text."""
        if path.stat().st_size > LARGEST_URDF:
            raise BadInput(
                f"{name} has {path.stat().st_size} bytes; a robot's URDF has {LARGEST_URDF} at most"
            )
        try:
            return cls(name, path.read_text("utf-8"))
        except UnicodeDecodeError as error:
            raise BadInput(f"{name} is no text; give a robot's URDF") from error

    def hand(self, hand: Handedness, bones: Mapping[str, str]) -> RobotHand:
        """``bones``: its links by the hand's bones (``bones_of``), where they have other names. Raises
        BadInput where it has no such hand."""
        name = self.name if self.urdf is not None else f"{self.name}_{hand}"
        text = urdf_of(name) if self.urdf is None else self.urdf
        return RobotHand.from_urdf(text, name, bones_of(bones, hand))
