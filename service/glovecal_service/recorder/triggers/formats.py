"""Which systems' triggers are received and sent, by name; a new one is registered here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_service.recorder.triggers import capture_xml, natnet, osc
from glovecal_service.recorder.triggers.trigger import Reader, Trigger


@dataclass(frozen=True)
class TriggerFormat:
    title: str
    port: int
    """Where the system sends to, or listens, unless it was set up otherwise."""
    reader: Callable[[], Reader]
    packets: Callable[[Trigger], list[bytes]]
    pause_s: float = 0.0
    """Between the packets of one trigger."""


TRIGGERS = {
    "vicon": TriggerFormat("Vicon's XML packets", 30, capture_xml.CaptureXml, capture_xml.packets),
    "motive": TriggerFormat("the XML packets of Motive", 1512, capture_xml.CaptureXml, capture_xml.packets),
    "qualisys": TriggerFormat("the XML packets of QTM", 8989, capture_xml.CaptureXml, capture_xml.packets),
    "natnet": TriggerFormat(
        "NatNet commands of OptiTrack", 1510, natnet.NatNet, natnet.packets, natnet.SETTLES_S
    ),
    "osc": TriggerFormat("OSC, as for Live Link Face", 8000, osc.Osc, osc.packets),
}
LOOPBACK = "127.0.0.1"


@dataclass(frozen=True)
class Endpoint:
    """A protocol at a UDP address."""

    protocol: str
    host: str
    port: int

    @classmethod
    def of_text(cls, text: str, *, host: str | None = LOOPBACK) -> Endpoint:
        """From ``vicon``, ``vicon:1512`` or ``vicon:0.0.0.0:1512``; ``host`` where none is given, None to
        ask for one. Raises BadInput."""
        protocol, _, address = text.partition(":")
        if protocol not in TRIGGERS:
            raise BadInput(f"no trigger {protocol[:40]!r}; {did_you_mean(protocol[:40], TRIGGERS)}")
        usual = TRIGGERS[protocol].port
        given, colon, number = address.rpartition(":")
        if not colon and number and not number.isdigit():
            given, number = number, ""
        if (number and not (number.isdigit() and 0 < int(number) < 65536)) or (colon and not given):
            raise BadInput(f"{text[:80]!r} must be PROTOCOL:HOST:PORT, as in {protocol}:{LOOPBACK}:{usual}")
        place = given or host
        if place is None:
            raise BadInput(f"say where {protocol} is to be sent, as in --send {protocol}:192.168.1.5:{usual}")
        return cls(protocol, place.strip("[]"), int(number or usual))

    @property
    def form(self) -> TriggerFormat:
        return TRIGGERS[self.protocol]

    def __str__(self) -> str:
        return f"{self.protocol}:{self.host}:{self.port}"
