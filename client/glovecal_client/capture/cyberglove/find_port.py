"""Which serial port has a CyberGlove on it."""

from __future__ import annotations

import fnmatch
import glob
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from typing import Any, Literal

from glovecal_client.capture.cyberglove.box import ControlBox
from glovecal_client.capture.cyberglove.connection import BAUD_RATES, Heard, ask_sensors, explain, kind_of
from glovecal_client.capture.cyberglove.identity import identify
from glovecal_client.capture.cyberglove.record import RecordFormat, RecordReader
from glovecal_client.capture.serial_link import SerialLink, import_pyserial
from glovecal_client.errors import DeviceError, DeviceLost

Kind = Literal["cyberglove", "silent", "echo", "text", "unreadable", "unusable"]
_LISTEN_S = 0.15
_ANSWER_S = 0.35
_PORTS_AT_ONCE = 8


@dataclass(frozen=True)
class FoundPort:
    """One serial port and what is on it."""

    path: str
    kind: Kind
    sentence: str
    """What answered, in words."""
    description: str = ""
    """What the operating system says about the port."""
    hardware_id: str = ""
    """USB vendor and product, ``0403:6001``; empty for other ports."""
    layout: str | None = None
    hand: str | None = None
    baud: int | None = None
    simulated: bool = False

    def to_json(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return asdict(self)


def find_ports(extra: Iterable[str] = ()) -> list[FoundPort]:
    """All serial ports of this computer and those matching ``extra`` (paths or patterns), each probed.

    Probing listens first and writes nothing to a port that talks by itself, unless it talks like a
    CyberGlove. Takes about 2 s. Raises DeviceError when pyserial is missing.
    """
    listed = _listed_ports()
    for pattern in extra:
        for path in sorted(glob.glob(pattern)) or fnmatch.filter(listed, pattern) or [pattern]:
            listed.setdefault(path, ("", ""))
    if not listed:
        return []
    with ThreadPoolExecutor(min(_PORTS_AT_ONCE, len(listed)), "find-port") as pool:
        return list(pool.map(lambda path: probe(path, *listed[path]), sorted(listed)))


def only_cyberglove() -> str:
    """The port of the only CyberGlove. Raises DeviceLost if there is none, DeviceError if there are more."""
    ports = find_ports()
    gloves = [port.path for port in ports if port.kind == "cyberglove"]
    if len(gloves) > 1:
        raise DeviceError(f"CyberGloves on {', '.join(gloves)}: say which, as in cyberglove:{gloves[0]}")
    if not gloves:
        looked = ", ".join(port.path for port in ports) or "none; is the cable plugged in?"
        raise DeviceLost(f"no CyberGlove found. Ports looked at: {looked}")
    return gloves[0]


def probe(path: str, description: str = "", hardware_id: str = "") -> FoundPort:
    """Look at one port. Never raises for what is, or is not, on it."""
    tries: list[Heard] = []
    try:
        for baud in BAUD_RATES:
            link = SerialLink(path, baud)
            try:
                found = _probe_at(link, description, hardware_id, tries)
            finally:
                link.close()
            if found is not None:
                return found
            if kind_of(tries[-1:]) == "text":
                break
    except DeviceError as error:
        return FoundPort(path, "unusable", str(error), description, hardware_id)
    return FoundPort(path, kind_of(tries), explain(path, tries), description, hardware_id)


def _probe_at(link: SerialLink, description: str, hardware_id: str, tries: list[Heard]) -> FoundPort | None:
    """Listen, and ask only silence or a CyberGlove's stream; adds what was heard to ``tries``."""
    box = ControlBox(link)
    heard = link.drain(quiet_s=_LISTEN_S, at_most_s=2 * _LISTEN_S)
    if _streams_records(heard):
        box.stop()
    elif heard and (more := link.read(_LISTEN_S)):  # it goes on; else it was the rest of something
        tries.append(Heard(link.baud, b"", heard + more))
        return None
    sensors, came = ask_sensors(box, _ANSWER_S)
    if sensors is None:
        tries.append(Heard(link.baud, b"?S", came))
        return None
    identity = identify(box, sensors)
    loose = "" if identity.plugged else "; the glove is not plugged into its control box"
    return FoundPort(
        link.path, "cyberglove", f"{identity} at {link.baud} baud{loose}", description, hardware_id,
        layout=identity.layout, hand=identity.hand, baud=link.baud, simulated=identity.simulated,
    )  # fmt: skip


def _streams_records(heard: bytes) -> bool:
    """Whether an earlier program left a CyberGlove streaming, in any of the record formats."""
    formats = [
        RecordFormat(sensors, timestamp, status)
        for sensors in (18, 22)
        for timestamp in (False, True)
        for status in (False, True)
    ]
    return any(_makes_sense(RecordReader(form), heard) for form in formats)


def _makes_sense(reader: RecordReader, heard: bytes) -> bool:
    records = reader.feed(heard)
    bad = sum(reader.errors[cause] for cause in "sg") + reader.errors["zero"]
    return len(records) + bad >= 2


def _listed_ports() -> dict[str, tuple[str, str]]:
    """Path -> description and USB id of the ports the operating system knows."""
    import_pyserial()
    from serial.tools import list_ports

    return {
        port.device: (
            "" if port.description in (None, "n/a") else port.description,
            f"{port.vid:04x}:{port.pid:04x}" if port.vid is not None else "",
        )
        for port in list_ports.comports()
    }
