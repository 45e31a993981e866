"""``serial-ports`` and ``glove-devices``: what is needed to connect a glove to the service's computer."""

from __future__ import annotations

import threading

from fastapi import APIRouter

from glovecal_client.capture.cyberglove.find_port import find_ports
from glovecal_client.capture.device import installed_devices
from glovecal_client.errors import DeviceError
from glovecal_client.session import DEFAULT_ENDPOINT
from glovecal_service.request_types import StrictBody
from glovecal_service.rest.glove.answer import GloveDevice, SerialPort
from glovecal_service.rest.http.dependencies import PartsNeeded
from glovecal_service.rest.http.list_part import InParts
from glovecal_service.rest.http.problem import change_problems, problems
from glovecal_service.store.errors import Conflict

router = APIRouter(tags=["gloves"])

_looking = threading.Lock()
"""Two that ask a port at once hear each other's answers."""


class AllPorts(StrictBody):
    """Nothing is chosen: the ports are those that the system lists."""


@router.post(
    "/serial-ports",
    response_model=list[SerialPort],
    summary="Look for gloves on serial ports",
    responses=change_problems(409),
)
def look_at_serial_ports(body: AllPorts) -> list[SerialPort]:
    """Every serial port of the service's computer, and what answers there, as `glovecal find-port` tells it.
    A port that talks by itself is only listened to; silence is asked whether it is a CyberGlove. Takes about
    two seconds."""
    try:
        with _looking:
            ports = find_ports()
    except DeviceError as error:
        raise Conflict(str(error)) from error
    return [
        SerialPort(
            path=port.path, kind=port.kind, sentence=port.sentence, description=port.description,
            device=f"cyberglove:{port.path}" if port.kind == "cyberglove" else None,
        )
        for port in ports
    ]  # fmt: skip


@router.get(
    "/glove-devices", response_model=list[GloveDevice], summary="Gloves that are known", responses=problems()
)
def list_glove_devices(parts: PartsNeeded, paging: InParts) -> list[GloveDevice]:
    """Those that are built in, and drivers installed on the service's computer."""
    zenoh = parts.settings.zenoh
    elsewhere = "" if zenoh == DEFAULT_ENDPOINT else f" --connect {zenoh}"
    devices = [
        GloveDevice(
            name=device.name, sentence=device.about,
            command=f"glovecal capture --device {device.usage} --glove GLOVE --subject SUBJECT{elsewhere}",
        )
        for device in installed_devices()
    ]  # fmt: skip
    return paging.part_of(devices, lambda device: device.name)
