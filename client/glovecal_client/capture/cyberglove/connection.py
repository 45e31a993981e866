"""Finding the CyberGlove control box behind a port: which baud rate it speaks, or why it is none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from glovecal_client.capture.cyberglove.box import RESTART, STOP, ControlBox, Unanswered
from glovecal_client.capture.cyberglove.order import LAYOUT_OF_COUNT
from glovecal_client.capture.cyberglove.verdict import Heard, explain, kind_of
from glovecal_client.capture.serial_link import SerialLink
from glovecal_client.errors import DeviceError, DeviceLost

BAUD_RATES = (115200, 38400, 19200, 9600)
"""Every driver since about 2000 uses the first, older ones the others."""
_QUESTION = b"?S"
_ANSWER_S = 0.5
_TRIES = 2
"""1 s in all: one driver gives the box that long after opening, another waits that long for an answer."""


@dataclass(frozen=True)
class Connection:
    """An open link to a box that has said how many sensors it has."""

    link: SerialLink
    box: ControlBox
    sensors: int


def connect(path: str, bauds: Sequence[int] = BAUD_RATES) -> Connection:
    """Open ``path`` at the first of ``bauds`` at which a CyberGlove answers.

    Takes at most about 8 s for four rates, the longest when all is silent. Raises DeviceLost when nothing
    answers or the port is gone, DeviceError when something else does; both name the likely cause.
    """
    tries: list[Heard] = []
    for baud in bauds:
        found, heard = _try(path, baud, greet=ControlBox.stop, greeting=STOP)
        if found is not None:
            return found
        tries.append(heard)
        if kind_of([heard]) in ("text", "echo"):
            break  # no wrong rate makes readable text, or gives back what was sent
    if kind_of(tries) != "silent":
        raise DeviceError(explain(path, tries))
    # A box whose firmware hangs listens to nothing but a restart.
    found, heard = _try(path, bauds[0], greet=ControlBox.restart, greeting=RESTART)
    if found is None:
        raise DeviceLost(explain(path, tries))
    return found


def _try(
    path: str, baud: int, *, greet: Callable[[ControlBox], bytes], greeting: bytes
) -> tuple[Connection | None, Heard]:
    """Greet and ask at one rate. The link stays open only when a box answered."""
    link = SerialLink(path, baud)
    box, sent, found = ControlBox(link), greeting, None
    try:
        came = greet(box)
        for _ in range(_TRIES):
            sent += _QUESTION
            sensors, heard = ask_sensors(box, _ANSWER_S)
            came += heard
            if sensors is not None:
                found = Connection(link, box, sensors)
                break
    finally:
        if found is None:
            link.close()
    return found, Heard(baud, sent, came)


def ask_sensors(box: ControlBox, reply_s: float) -> tuple[int | None, bytes]:
    """The number of sensors a box answers with, None if the answer is no box's; and what came."""
    try:
        sensors = box.query("S", 1, reply_s=reply_s, tries=1)[0]
    except Unanswered as error:
        return None, error.heard
    came = _QUESTION + bytes([sensors, 0])
    # 14 and 16 sensors were built too; identify() refuses them by name. Anything else is chance.
    return (sensors if sensors in (*LAYOUT_OF_COUNT, 14, 16) else None), came
