"""Which gloves are emulated, with which faults, and how one is captured."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_service.emulators import lines
from glovecal_service.emulators.cyberglove import EmulatedCyberGlove
from glovecal_service.emulators.cyberglove3 import EmulatedCyberGlove3
from glovecal_service.emulators.glove import (
    EVERY_GLOVE,
    WITH_BATTERY,
    WITH_CLOCK,
    WITH_ECHO,
    WITH_FRAGMENTS,
    EmulatedGlove,
    Faults,
)
from glovecal_service.emulators.hand import MovingHand
from glovecal_service.emulators.lines import EmulatedHomunculus, EmulatedLucidGlove
from glovecal_service.emulators.opencyberglove import EmulatedOpenCyberGlove

Maker = Callable[[MovingHand, Faults, bool], EmulatedGlove]
"""Makes a glove with a hand and faults; True when it is reached over the network."""


@dataclass(frozen=True)
class Protocol:
    """An emulated protocol."""

    make: Maker
    faults: dict[str, str]
    """Name and explanation of each fault that it can have."""
    device: str
    """The capture device that reads it, ``{port}`` where the port goes."""
    links: tuple[str, ...] = ("port",)
    note: str = ""
    """What the user needs besides, such as a description file."""


_CLOCK = EVERY_GLOVE | WITH_CLOCK
_ADDRESSES = ("port", "tcp")
PROTOCOLS: dict[str, Protocol] = {
    "cyberglove": Protocol(
        lambda hand, faults, _: EmulatedCyberGlove(hand, faults), _CLOCK, "cyberglove:{port}"
    ),
    "cyberglove3": Protocol(
        lambda hand, faults, network: EmulatedCyberGlove3(hand, faults, link="w" if network else "u"),
        _CLOCK | WITH_BATTERY | WITH_ECHO | WITH_FRAGMENTS,
        "cyberglove3:{port}",
        _ADDRESSES,
    ),
    "lucidglove": Protocol(
        lambda hand, faults, _: EmulatedLucidGlove(hand, faults), EVERY_GLOVE, "lucidglove:{port}", _ADDRESSES
    ),
    "lucidglove-legacy": Protocol(
        lambda hand, faults, _: EmulatedLucidGlove(hand, faults, legacy=True),
        EVERY_GLOVE,
        "lucidglove:{port} --option encoding=legacy",
        _ADDRESSES,
    ),
    "opencyberglove": Protocol(
        lambda hand, faults, _: EmulatedOpenCyberGlove(hand, faults), _CLOCK, "opencyberglove:{port}"
    ),
    "homunculus": Protocol(
        lambda hand, faults, _: EmulatedHomunculus(hand, faults), EVERY_GLOVE, "homunculus:{port}"
    ),
    "line": Protocol(
        lambda hand, faults, _: lines.EmulatedLineGlove(hand, faults),
        _CLOCK | WITH_BATTERY,
        "line:line-glove.toml --option port={port}",
        ("port", "tcp", "udp"),
        f"line-glove.toml:\n\n{lines.DESCRIPTION}",
    ),
}


def protocol(name: str) -> Protocol:
    """Raises BadInput with the names there are."""
    if name not in PROTOCOLS:
        raise BadInput(f"no emulated glove {name!r}; {did_you_mean(name, PROTOCOLS)}")
    return PROTOCOLS[name]


def faults_of(name: str, names: Collection[str], seed: int) -> Faults:
    """Raises BadInput for a fault that the protocol cannot have."""
    possible = protocol(name).faults
    for fault in names:
        if fault not in possible:
            raise BadInput(f"{name} has no fault {fault!r}; {did_you_mean(fault, possible)}")
    return Faults(names, seed)
