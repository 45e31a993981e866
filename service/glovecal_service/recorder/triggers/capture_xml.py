"""The XML packets ``CaptureStart`` and ``CaptureStop`` of Vicon, as Motive, Qualisys, MANUS and others send
and take them."""

from __future__ import annotations

import math
import os
import socket
from xml.etree import ElementTree

from glovecal_service.recorder.triggers.trigger import Request, Trigger, UnknownPacket, one_line

LARGEST_PACKET = 16_384
"""Bytes; Vicon's fit into one Ethernet frame."""
MOST_ELEMENTS = 64
LONGEST_DELAY_S = 60.0
_STARTS, _STOPS = "CaptureStart", "CaptureStop"


class CaptureXml:
    """Names of elements and attributes are taken in capitals or not."""

    def read(self, packet: bytes) -> Request:
        """Raises UnknownPacket."""
        root = _parsed(packet)
        tag = _local(root.tag)
        if tag not in (_STARTS.lower(), _STOPS.lower()):
            raise UnknownPacket(f"the XML's root is {one_line(root.tag, 40)!r}, no {_STARTS} or {_STOPS}")
        values = {_local(child.tag): _attribute(child, "value") for child in root}
        return Request(
            Trigger(
                action="start" if tag == _STARTS.lower() else "stop",
                name=one_line(values.get("name", "")),
                packet_id=one_line(values.get("packetid", "")),
                notes=one_line(values.get("notes", "")),
                description=one_line(values.get("description", "")),
                time_code=one_line(values.get("timecode", "")),
                result=one_line(_attribute(root, "result")).upper(),
                delay_s=_delay_s(values.get("delay", "")),
            )
        )


def packets(trigger: Trigger) -> list[bytes]:
    """The packet, ended by a NUL as Vicon's are."""
    root = ElementTree.Element(_STARTS if trigger.action == "start" else _STOPS)
    if trigger.action == "stop":
        root.set("RESULT", trigger.result or "SUCCESS")
    values = {"Name": trigger.name, "Notes": trigger.notes, "Description": trigger.description}
    values |= {"DatabasePath": ""}
    if trigger.action == "start":
        values["Delay"] = "0"
    if trigger.time_code:
        values["TimeCode"] = trigger.time_code
    values |= {"PacketID": trigger.packet_id, "HostName": socket.gethostname(), "ProcessID": str(os.getpid())}
    for name, value in values.items():
        ElementTree.SubElement(root, name, VALUE=value)
    text = ElementTree.tostring(root, encoding="unicode")
    return [f'<?xml version="1.0" encoding="UTF-8" standalone="no" ?>{text}'.encode() + b"\0"]


def _parsed(packet: bytes) -> ElementTree.Element:
    if len(packet) > LARGEST_PACKET:
        raise UnknownPacket(f"{len(packet)} bytes; a trigger has at most {LARGEST_PACKET}")
    begin, end = packet.find(b"<"), packet.rfind(b">")
    if begin < 0 or end < begin:
        raise UnknownPacket("it is no XML")
    try:
        text = packet[begin : end + 1].decode("utf-8")
    except UnicodeDecodeError:
        text = packet[begin : end + 1].decode("latin-1")
    if "<!" in text or text.count("<") > MOST_ELEMENTS:
        raise UnknownPacket("its XML declares a document type or entities, or is no trigger for its size")
    if text.startswith("<?xml"):  # it was decoded above
        text = text.partition("?>")[2].lstrip()
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError):
        raise UnknownPacket("it is no whole XML") from None


def _local(tag: str) -> str:
    return tag.rpartition("}")[2].lower()


def _attribute(element: ElementTree.Element, wanted: str) -> str:
    return next((value for name, value in element.attrib.items() if _local(name) == wanted), "")


def _delay_s(milliseconds: str) -> float:
    try:
        delay_s = float(milliseconds) / 1e3
    except ValueError:
        return 0.0
    return min(max(delay_s, 0.0), LONGEST_DELAY_S) if math.isfinite(delay_s) else 0.0
