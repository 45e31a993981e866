"""Finding the CyberGlove control box behind a port: which baud rate it speaks, or why it is none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from glovecal_client.capture.cyberglove_box import RESTART, STOP, ControlBox, Unanswered
from glovecal_client.capture.cyberglove_order import LAYOUT_OF_COUNT
from glovecal_client.capture.cyberglove_verdict import Heard, explain, kind_of
from glovecal_client.capture.serial_link import SerialLink
from glovecal_client.errors import DeviceError, DeviceLost

BAUD_RATES = (115200, 38400, 19200, 9600)
"""Every driver since about 2000 uses the first, older ones the others."""
_QUESTION = b"?S"
_FIRST_ANSWER_S = 0.6
_TRIES = 2
"""Together with the time a stop takes: one driver waits 1 s after opening before the box listens."""


@dataclass(frozen=True)
class Connection:
    """An open link to a box that has said how many sensors it has."""

    link: SerialLink
    box: ControlBox
    sensors: int


def connect(path: str, bauds: Sequence[int] = BAUD_RATES) -> Connection:
    """Open ``path`` at the first of ``bauds`` at which a CyberGlove answers.

    Takes at most about 7 s for four rates. Raises DeviceLost when nothing answers or the port is gone,
    DeviceError when something else does; both name the likely cause.
    """
    tries: list[Heard] = []
    for baud in bauds:
        found, heard = _try(path, baud, greet=ControlBox.stop, greeting=STOP)
        if found is not None:
            return found
        tries.append(heard)
    if kind_of(tries) != "silent":
        raise DeviceError(explain(path, tries))
    # A box whose firmware hangs listens to nothing but a restart.
    found, heard = _try(path, bauds[0], greet=ControlBox.restart, greeting=RESTART)
    if found is None:
        raise DeviceLost(explain(path, tries))
    return found


def _try(path: str, baud: int, *, greet, greeting: bytes) -> tuple[Connection | None, Heard]:
    """Greet and ask at one rate. The link stays open only when a box answered."""
    link = SerialLink(path, baud)
    box = ControlBox(link)
    sent, came = greeting, b""
    try:
        came = greet(box)
        for _ in range(_TRIES):
            sent += _QUESTION
            sensors, heard = ask_sensors(box, _FIRST_ANSWER_S)
            came += heard
            if sensors is not None:
                found, link = Connection(link, box, sensors), None
                return found, Heard(baud, sent, came)
        return None, Heard(baud, sent, came)
    finally:
        if link is not None:
            link.close()


def ask_sensors(box: ControlBox, reply_s: float) -> tuple[int | None, bytes]:
    """The number of sensors a box answers with, None if the answer is no box's; and what came."""
    try:
        sensors = box.query("S", 1, reply_s=reply_s, tries=1)[0]
    except Unanswered as error:
        return None, error.heard
    came = _QUESTION + bytes([sensors, 0])
    # 14 and 16 sensors were built too; identify() refuses them by name. Anything else is chance.
    return (sensors if sensors in (*LAYOUT_OF_COUNT, 14, 16) else None), came
