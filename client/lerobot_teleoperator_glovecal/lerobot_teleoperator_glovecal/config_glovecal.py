"""How the teleoperator is configured, on LeRobot's command line or in its configuration file."""

# pyright: reportMissingImports=false

from __future__ import annotations

from dataclasses import dataclass, field

from lerobot.teleoperators.config import TeleoperatorConfig

from lerobot_teleoperator_glovecal.joint_actions import JointAction


@TeleoperatorConfig.register_subclass("glovecal")
@dataclass
class GlovecalTeleoperatorConfig(TeleoperatorConfig):
    glove: str = "right"
    actions: dict[str, JointAction] = field(default_factory=dict)
    """By the names of the robot's ``action_features``."""
    robot: str = ""
    """In place of actions, a robot's hand that does what the person's does: shadow, allegro, leap or a URDF
    file. Its actions are ``JOINT.pos``."""
    side: str = "right"
    """Of that robot's hand: right or left."""
    unit: str = "radians"
    """Of its joints: radians or degrees."""
    site: str = "lab"
    connect: str = "tcp/127.0.0.1:7447"
    """The service's zenoh endpoint."""
    hold_s: float = 0.2
    ramp_s: float = 2.0
    allow_simulated: bool = False
