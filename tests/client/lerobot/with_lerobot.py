"""Runs in an environment with the real LeRobot: finds the plug-in by name, and lets its loop move a robot.

Called with the zenoh endpoint and ``hold_s``. What LeRobot imports for learning (torch and others,
gigabytes of them) is stood in for by modules that hold nothing.
"""

# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

import importlib.abc
import importlib.machinery
import json
import sys
import types
from collections.abc import MutableSequence
from dataclasses import make_dataclass
from typing import Any

HEAVY = {
    "torch", "torchvision", "accelerate", "datasets", "safetensors", "pandas", "cv2", "einops", "rerun", "av",
    "imageio", "gymnasium", "transformers", "jsonlines", "pynput", "PIL", "pyarrow", "requests", "diffusers",
    "termcolor", "lerobot.policies", "lerobot.envs",
}  # fmt: skip


class Nothing(type):
    """A class that has any attribute, and decorates by giving back what it is given."""

    def __getattr__(cls, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return Nothing(name, (), {})

    def __call__(cls, *arguments: Any, **options: Any) -> Any:
        return arguments[0] if len(arguments) == 1 and callable(arguments[0]) else super().__call__()

    def __or__(cls, other: Any) -> Any:
        return cls

    def __ror__(cls, other: Any) -> Any:
        return cls

    def __getitem__(cls, item: Any) -> Any:
        return cls


class StandIn(types.ModuleType):
    __path__: MutableSequence[str] = []  # noqa: RUF012

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return Nothing(name, (), {})


class StandIns(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    def find_spec(self, name: str, path: Any = None, target: Any = None) -> Any:
        parts = name.split(".")
        if parts[0] in HEAVY or ".".join(parts[:2]) in HEAVY:
            return importlib.machinery.ModuleSpec(name, self, is_package=True)
        return None

    def create_module(self, spec: Any) -> types.ModuleType:
        return StandIn(spec.name)

    def exec_module(self, module: types.ModuleType) -> None:
        pass


class Robot:
    """Keeps what it is sent."""

    name = "hand"

    def __init__(self, names: list[str]) -> None:
        self.action_features = dict.fromkeys(names, float)
        self.sent: list[dict[str, float]] = []

    def get_observation(self) -> dict[str, float]:
        return self.sent[-1] if self.sent else {}

    def send_action(self, action: dict[str, float]) -> dict[str, float]:
        self.sent.append(dict(action))
        return action


def main(endpoint: str, hold_s: str) -> None:
    sys.meta_path.insert(0, StandIns())
    import draccus
    from lerobot.scripts.lerobot_teleoperate import teleop_loop
    from lerobot.teleoperators.config import TeleoperatorConfig
    from lerobot.teleoperators.utils import make_teleoperator_from_config
    from lerobot.utils.import_utils import register_third_party_plugins

    register_third_party_plugins()
    actions = {
        "index.pos": {"gains": {"I_PIP": 2.0}, "low": 0.0, "high": 80.0},
        "middle.pos": {"gains": {"M_PIP": 1.0}},
    }
    settings = make_dataclass("Settings", [("teleop", TeleoperatorConfig)])
    options = {
        "type": "glovecal", "glove": "right", "connect": endpoint, "actions": json.dumps(actions),
        "ramp_s": 0, "hold_s": hold_s, "allow_simulated": "true",
    }  # fmt: skip
    words = [f"--teleop.{name}={value}" for name, value in options.items()]
    config = draccus.parse(settings, args=words).teleop
    teleoperator = make_teleoperator_from_config(config)
    teleoperator.connect()
    robot = Robot(list(actions))
    report: dict[str, Any] = {
        "type": config.type, "name": teleoperator.name, "calibrated": teleoperator.is_calibrated,
        "features": sorted(teleoperator.action_features),
    }  # fmt: skip
    print(json.dumps(report), flush=True)

    def loop(duration: float | None) -> None:
        first = lambda pair: pair[0]  # noqa: E731
        teleop_loop(teleoperator, robot, 60, first, first, dict, duration=duration)

    while len(robot.sent) <= 10:
        loop(1.0)
    print("\n" + json.dumps({"count": len(robot.sent), "last": robot.sent[-1]}), flush=True)
    try:
        loop(None)  # until the glove falls silent
    except Exception as error:
        print("\n" + json.dumps({"kind": type(error).__name__, "why": str(error)}), flush=True)
    finally:
        teleoperator.disconnect()


if __name__ == "__main__":
    main(*sys.argv[1:])
