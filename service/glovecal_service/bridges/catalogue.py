"""The live bridges there are, by name: a bridge is one file, one line here, one test."""

from __future__ import annotations

from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_service.bridges.bridge import Bridge
from glovecal_service.bridges.foxglove import FoxgloveBridge
from glovecal_service.bridges.lsl import LslBridge
from glovecal_service.bridges.rokoko import RokokoBridge
from glovecal_service.bridges.ros2 import Ros2Bridge
from glovecal_service.bridges.unreal import UnrealBridge
from glovecal_service.bridges.vmc import VmcBridge
from glovecal_service.bridges.websocket import WebSocketBridge

BRIDGES: dict[str, type[Bridge]] = {
    "websocket": WebSocketBridge,
    "lsl": LslBridge,
    "ros2": Ros2Bridge,
    "foxglove": FoxgloveBridge,
    "vmc": VmcBridge,
    "unreal": UnrealBridge,
    "rokoko": RokokoBridge,
}


def bridge_class(name: str) -> type[Bridge]:
    """Raises BadInput for an unknown name, and where a package is missing, with the command to install it."""
    if name not in BRIDGES:
        raise BadInput(f"no bridge {name!r}; {did_you_mean(name, BRIDGES)}")
    BRIDGES[name].require_installed(name)
    return BRIDGES[name]
