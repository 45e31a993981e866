"""A robot's hand that follows poses as they come, one by one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.hand.retargeting.robot import RobotHand
from glovecal_models.hand.retargeting.robot_retarget import RobotRetargeting
from glovecal_models.hand.rotations import FINGERS, PALM, HeldAngles
from glovecal_models.hand.skeleton import Skeleton

_WRIST = "W"


class RobotFollower:
    """Follows one hand. Raises BadInput where hand and robot have no two fingers in common."""

    def __init__(self, skeleton: Skeleton, robot: RobotHand) -> None:
        self._retargeting = RobotRetargeting(skeleton, robot)
        letters = {letter for letter, finger in FINGERS.items() if finger in robot.fingers}
        if self._retargeting.turns_wrist:
            letters.add(_WRIST)
        self.needed = frozenset(
            name for name in skeleton.rotations if name != PALM and set(name.partition("_")[0]) <= letters
        )
        """Rotations of the hand that move the robot."""
        self._held = HeldAngles()
        self._before: np.ndarray | None = None

    @property
    def straight(self) -> dict[str, float]:
        """Radians of the robot's joints where every rotation of the hand is at 0."""
        flat = np.zeros((1, len(self._retargeting.skeleton.rotations)))
        return dict(
            zip(self._retargeting.robot.free, self._retargeting.radians(flat)[0].tolist(), strict=True)
        )

    def radians(
        self, rotations: Sequence[str], degrees: np.ndarray, usable: np.ndarray
    ) -> dict[str, float] | None:
        """Of the robot's joints, within their limits; ``degrees`` (K,) and ``usable`` (K,) bool of
        ``rotations``. None where one that is needed is not usable: then nothing must move the robot. A
        rotation that the model does not have follows its rule, or rests."""
        given = zip(rotations, usable.tolist(), strict=True)
        if any(name in self.needed and not is_usable for name, is_usable in given):
            return None
        skeleton = self._retargeting.skeleton
        angles = np.array([self._held.degrees(skeleton.rotations, rotations, degrees, usable)])
        self._before = now = self._retargeting.radians(angles, self._before)[0]
        return dict(zip(self._retargeting.robot.free, now.tolist(), strict=True))
