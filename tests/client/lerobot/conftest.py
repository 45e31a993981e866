"""The plug-in with what it imports of LeRobot; LeRobot itself is tried in an environment of its own."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType
from typing import Any

PLUG_IN = Path(__file__).resolve().parents[3] / "client/lerobot_teleoperator_glovecal"


class TeleoperatorConfig:
    known: dict[str, type] = {}  # noqa: RUF012

    @classmethod
    def register_subclass(cls, name: str) -> Any:
        return lambda kind: cls.known.setdefault(name, kind)


class Teleoperator:
    def __init__(self, config: Any) -> None:
        pass


config = ModuleType("lerobot.teleoperators.config")
teleoperator = ModuleType("lerobot.teleoperators.teleoperator")
config.__dict__["TeleoperatorConfig"] = TeleoperatorConfig
teleoperator.__dict__["Teleoperator"] = Teleoperator
for module in (ModuleType("lerobot"), ModuleType("lerobot.teleoperators"), config, teleoperator):
    sys.modules.setdefault(module.__name__, module)
sys.path[:0] = [str(PLUG_IN), str(PLUG_IN / "examples"), str(Path(__file__).parent)]
