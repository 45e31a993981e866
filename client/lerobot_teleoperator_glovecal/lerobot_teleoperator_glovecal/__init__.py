"""LeRobot's teleoperator ``glovecal``: calibrated joints of a data glove as a robot's actions."""

from lerobot_teleoperator_glovecal.config_glovecal import GlovecalTeleoperatorConfig
from lerobot_teleoperator_glovecal.glovecal import GlovecalTeleoperator

__all__ = ["GlovecalTeleoperator", "GlovecalTeleoperatorConfig"]
