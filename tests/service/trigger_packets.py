"""Packets as other systems send them, typed from their documentation: none is made by our own sender."""

from __future__ import annotations

import struct

START = (
    b'<?xml version="1.0" encoding="UTF-8" standalone="no" ?>\n<CaptureStart>\n  <Name VALUE="Walk 01"/>\n'
    b'  <Notes VALUE="slow &amp; wide"/>\n  <Description VALUE="second day"/>\n'
    b'  <DatabasePath VALUE="D:/Captures/Monday/"/>\n  <Delay VALUE="33"/>\n'
    b'  <TimeCode VALUE="10:20:30:12"/>\n  <PacketID VALUE="28472"/>\n</CaptureStart>\n\0'
)
"""Vicon Nexus; its buffer is sent with the text's ending NUL."""
STOP = (
    b'<?xml version="1.0" encoding="UTF-8" standalone="no" ?><CaptureStop RESULT="SUCCESS">'
    b'<Name VALUE="Walk 01" /><DatabasePath VALUE="D:/Captures/Monday/" /><Delay VALUE="33" />'
    b'<PacketID VALUE="28473" /></CaptureStop>'
)


def natnet(command: str) -> bytes:
    """Message 2 of the NatNet SDK: number, length, a text that ends with a NUL."""
    return struct.pack("<HH", 2, len(command) + 1) + command.encode("ascii") + b"\x00"


RECORD_START = b"/RecordStart\0\0\0\0" + b",si\0" + b"Scene\0\0\0" + b"\0\0\0\x04"
RECORD_STOP = b"/RecordStop\0" + b",\0\0\0"
