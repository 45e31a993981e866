"""LeRobot's ``Teleoperator`` over one glove."""

# pyright: reportMissingImports=false

from __future__ import annotations

from typing import Any

from lerobot.teleoperators.teleoperator import Teleoperator

from lerobot_teleoperator_glovecal.config_glovecal import GlovecalTeleoperatorConfig
from lerobot_teleoperator_glovecal.glove_link import GloveLink
from lerobot_teleoperator_glovecal.joint_actions import HandMapping, JointActions, SummedRotations
from lerobot_teleoperator_glovecal.robot_joints import RobotJoints


def mapping_of(config: GlovecalTeleoperatorConfig) -> HandMapping:
    """How the configured robot is told what the hand does. Raises ValueError."""
    if not config.robot:
        return SummedRotations(config.actions)
    if config.actions:
        raise ValueError("robot and actions: give one of them")
    return RobotJoints(config.robot, config.side, config.unit)


class GlovecalTeleoperator(Teleoperator):
    """``get_action`` raises ``GloveNotUsable`` where the pose cannot be trusted: LeRobot's loop ends."""

    config_class = GlovecalTeleoperatorConfig
    name = "glovecal"

    def __init__(self, config: GlovecalTeleoperatorConfig) -> None:
        """Raises ValueError for actions that cannot be."""
        super().__init__(config)
        self.config = config
        mapping = mapping_of(config)
        self._names = tuple(mapping.start)
        self._actions = JointActions(
            config.glove, mapping, config.hold_s, config.ramp_s, config.allow_simulated
        )
        self._link = GloveLink(self._actions, site=config.site, endpoint=config.connect)

    @property
    def action_features(self) -> dict[str, type]:
        return dict.fromkeys(self._names, float)

    @property
    def feedback_features(self) -> dict[str, type]:
        return {}

    @property
    def is_connected(self) -> bool:
        return self._link.is_connected

    def connect(self, calibrate: bool = True) -> None:
        """Raises GloveNotUsable with what has to be done first."""
        self._link.connect()

    @property
    def is_calibrated(self) -> bool:
        """Its calibration is the service's; without one ``connect`` refuses."""
        return True

    def calibrate(self) -> None:
        """Nothing: ``glovecal`` calibrates."""

    def configure(self) -> None:
        """Nothing."""

    def get_action(self) -> dict[str, float]:
        return self._link.get_action()

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Nothing: the glove has no actuators."""

    def disconnect(self) -> None:
        self._link.disconnect()
