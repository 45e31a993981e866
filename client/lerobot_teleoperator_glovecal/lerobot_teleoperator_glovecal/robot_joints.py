"""Joint angles of a robot's hand, found so that it shows what the person's hand does (extra ``robots``)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from lerobot_teleoperator_glovecal.joint_actions import GloveNotUsable

UNITS = {"radians": 1.0, "degrees": 180.0 / math.pi}
SIDES = ("right", "left")
SUFFIX = ".pos"


class RobotJoints:
    """As ``HandMapping``; its actions are ``JOINT.pos``. The kinematics are those of ``glovecal-models``."""

    def __init__(self, robot: str, side: str, unit: str) -> None:
        """``robot``: shadow, allegro, leap or a URDF file. Raises ValueError, which says what can be."""
        try:
            from glovecal_models.errors import BadInput
            from glovecal_models.hand.retargeting.robot_description import RobotDescription
        except ModuleNotFoundError as error:
            raise ValueError(
                "robot: this needs glovecal-models; pip install ./models beside the plug-in"
            ) from error
        if side not in SIDES or unit not in UNITS:
            raise ValueError(
                f"side is {side!r} and unit {unit!r}; side: right or left, unit: {' or '.join(UNITS)}"
            )
        self._side, self._factor = side, UNITS[unit]
        try:
            self._robot = RobotDescription.named(robot).hand(side, {})  # pyright: ignore[reportArgumentType]
        except BadInput as error:
            raise ValueError(f"robot: {error}") from error
        self._follow(None)
        self.rotations: set[str] = set()

    def _follow(self, skeleton: Mapping[str, Any] | None) -> None:
        """``skeleton``: of ``pose/meta``; None: a hand of usual size."""
        from glovecal_models.hand.retargeting.robot_follower import RobotFollower
        from glovecal_models.hand.skeleton import hand_skeleton, skeleton_from_document

        made = hand_skeleton(hand=self._side) if skeleton is None else skeleton_from_document(skeleton)  # pyright: ignore[reportArgumentType]
        self._follower = RobotFollower(made, self._robot)

    @property
    def start(self) -> dict[str, float]:
        return self._told(self._follower.straight)

    def know(self, meta: Mapping[str, Any]) -> None:
        """Follow the hand that ``pose/meta`` describes. Raises GloveNotUsable for the other hand's glove."""
        if meta.get("hand") not in (self._side, None, "unknown"):
            raise GloveNotUsable(
                f"the glove is on the {meta.get('hand')} hand, the robot's is a {self._side} one; set side"
            )
        self._follow(meta.get("skeleton"))
        self.rotations = set(self._follower.needed) & set(map(str, meta.get("rotations") or ()))

    def values(self, degrees: Mapping[str, float]) -> dict[str, float]:
        import numpy as np

        names = tuple(name for name in degrees if name in self.rotations)
        angles = np.array([degrees[name] for name in names], dtype=float)
        radians = self._follower.radians(names, angles, np.ones(len(names), dtype=bool))
        assert radians is not None, "all that is given is usable"
        return self._told(radians)

    def _told(self, radians: Mapping[str, float]) -> dict[str, float]:
        return {f"{name}{SUFFIX}": angle * self._factor for name, angle in radians.items()}
