"""NatNet's remote commands, as they are sent to OptiTrack Motive (UDP port 1510)."""

from __future__ import annotations

import struct

from glovecal_service.recorder.triggers.trigger import Request, Trigger, UnknownPacket, one_line

REQUEST, RESPONSE, UNRECOGNIZED = 2, 3, 100
"""Message numbers of the protocol."""
_HEADER = struct.Struct("<HH")
DONE, REFUSED = 0, 1
SETTLES_S = 0.1
"""Motive takes a name on some time after its packet."""


class NatNet:
    def __init__(self) -> None:
        self._name = ""

    def read(self, packet: bytes) -> Request:
        """Raises UnknownPacket."""
        if len(packet) < _HEADER.size:
            raise UnknownPacket(f"{len(packet)} bytes; a NatNet message has at least {_HEADER.size}")
        message, length = _HEADER.unpack_from(packet)
        body = packet[_HEADER.size : _HEADER.size + length]
        if message != REQUEST:
            raise UnknownPacket(f"NatNet message {message}; commands are message {REQUEST}")
        command, _, argument = body.partition(b"\0")[0].decode("utf-8", "replace").partition(",")
        if command == "SetRecordTakeName":
            self._name = one_line(argument)
            return Request(None, _response(DONE))
        if command in ("StartRecording", "StopRecording"):
            name, self._name = self._name, "" if command == "StopRecording" else self._name
            action = "start" if command == "StartRecording" else "stop"
            return Request(Trigger(action, name=name), _response(DONE), _response(REFUSED))
        return Request(None, _HEADER.pack(UNRECOGNIZED, 0))


def packets(trigger: Trigger) -> list[bytes]:
    """At the begin the name and the command, to be sent ``SETTLES_S`` apart; at the end the command."""
    if trigger.action == "stop":
        return [_request("StopRecording")]
    named = [_request(f"SetRecordTakeName,{trigger.name}")] if trigger.name else []
    return [*named, _request("StartRecording")]


def _request(command: str) -> bytes:
    body = command.encode() + b"\0"
    return _HEADER.pack(REQUEST, len(body)) + body


def _response(code: int) -> bytes:
    return _HEADER.pack(RESPONSE, 4) + struct.pack("<i", code)
