"""OSC messages ``/RecordStart`` and ``/RecordStop``, as Live Link Face takes and confirms them."""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence

from glovecal_service.recorder.triggers.trigger import Request, Trigger, UnknownPacket, one_line

LARGEST_PACKET = 16_384
MOST_ARGUMENTS = 32
NO_TIME_CODE = "00:00:00.000"
"""What the application itself confirms with."""
_NUMBERED = re.compile(r"(.+)_(\d{1,9})\Z")

Argument = str | int | float | bytes | bool | None


class Osc:
    """``/Slate``, ``/Take`` and ``/OSCSetSendTarget`` are remembered; a confirmation goes to the sender's
    address, at the port that it named, never to another computer."""

    def __init__(self) -> None:
        self._slate, self._take = "", ""
        self._answer_port: int | None = None

    def read(self, packet: bytes) -> Request:
        """Raises UnknownPacket."""
        address, arguments = decode_message(packet)
        command = address.lower()
        if command == "/recordstart":
            return self._start(arguments)
        if command == "/recordstop":
            done = encode_message("/RecordStopConfirm", NO_TIME_CODE, "", "")
            return Request(Trigger("stop"), done, answer_port=self._answer_port)
        self._remember(command, arguments)
        return Request(None)

    def _start(self, arguments: Sequence[Argument]) -> Request:
        given = [*arguments, None, None]
        slate = self._slate if given[0] is None else str(given[0])
        take = self._take if given[1] is None else str(given[1])
        name = one_line("_".join(filter(None, (slate, take))))
        done = encode_message("/RecordStartConfirm", NO_TIME_CODE)
        return Request(Trigger("start", name=name), done, answer_port=self._answer_port)

    def _remember(self, command: str, arguments: Sequence[Argument]) -> None:
        if command == "/slate" and len(arguments) == 1:
            self._slate = one_line(str(arguments[0]))
        elif command == "/take" and len(arguments) == 1:
            self._take = one_line(str(arguments[0]))
        elif command == "/oscsetsendtarget" and len(arguments) == 2 and isinstance(arguments[1], int):
            if not 0 < arguments[1] < 65536:
                raise UnknownPacket(f"/OSCSetSendTarget names port {arguments[1]}")
            self._answer_port = arguments[1]
        else:
            raise UnknownPacket(f"OSC message {one_line(command, 40)!r} begins or ends no recording")


def packets(trigger: Trigger) -> list[bytes]:
    """A name that ends in a number is slate and take; else it is take 1."""
    if trigger.action == "stop":
        return [encode_message("/RecordStop")]
    numbered = _NUMBERED.match(trigger.name)
    slate, take = (numbered[1], int(numbered[2])) if numbered else (trigger.name, 1)
    return [encode_message("/RecordStart", slate, take)]


def encode_message(address: str, *arguments: str | int) -> bytes:
    """An OSC 1.0 message of strings and 32-bit integers."""
    tags = "," + "".join("i" if isinstance(each, int) else "s" for each in arguments)
    values = [struct.pack(">i", each) if isinstance(each, int) else _text(each) for each in arguments]
    return _text(address) + _text(tags) + b"".join(values)


def decode_message(packet: bytes) -> tuple[str, list[Argument]]:
    """Address and arguments; the first message of a bundle. Raises UnknownPacket."""
    if len(packet) > LARGEST_PACKET:
        raise UnknownPacket(f"{len(packet)} bytes; an OSC message has at most {LARGEST_PACKET}")
    if packet.startswith(b"#bundle\0"):
        size = int.from_bytes(packet[16:20], "big")
        packet = packet[20 : 20 + size]
    if not packet.startswith(b"/"):
        raise UnknownPacket("it is no OSC message: it does not begin with an address")
    address, at = _read_text(packet, 0)
    tags, at = _read_text(packet, at) if at < len(packet) else (",", at)
    if not tags.startswith(",") or len(tags) > MOST_ARGUMENTS + 1:
        raise UnknownPacket("it is no OSC message: it does not tell the types of its arguments")
    arguments: list[Argument] = []
    for tag in tags[1:]:
        value, at = _read_argument(packet, at, tag)
        arguments.append(value)
    return address, arguments


_FIXED = {"i": ">i", "f": ">f", "h": ">q", "d": ">d", "t": ">Q"}
_WORDS: dict[str, Argument] = {"T": True, "F": False, "N": None, "I": None}


def _read_argument(packet: bytes, at: int, tag: str) -> tuple[Argument, int]:
    if tag in _WORDS:
        return _WORDS[tag], at
    if tag in "sS":
        return _read_text(packet, at)
    form = _FIXED.get(tag)
    if form is None:
        raise UnknownPacket(f"an argument of its OSC message has type {tag!r}")
    end = at + struct.calcsize(form)
    if end > len(packet):
        raise UnknownPacket("its OSC message ends in the middle of an argument")
    return struct.unpack(form, packet[at:end])[0], end


def _read_text(packet: bytes, at: int) -> tuple[str, int]:
    end = packet.find(b"\0", at)
    if end < 0:
        raise UnknownPacket("its OSC message ends in the middle of a text")
    return packet[at:end].decode("utf-8", "replace"), end + 4 - end % 4


def _text(text: str) -> bytes:
    encoded = text.replace("\0", "").encode() + b"\0"
    return encoded + b"\0" * (-len(encoded) % 4)
