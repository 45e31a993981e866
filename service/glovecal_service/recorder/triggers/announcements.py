"""Sends triggers to other systems when a recording of the named gloves begins or ends here."""

from __future__ import annotations

import secrets
import socket
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Literal

from glovecal_client.clock import clock_s
from glovecal_models.errors import BadInput
from glovecal_models.takes.time_code import TimeCode
from glovecal_service.recorder.triggers.formats import Endpoint
from glovecal_service.recorder.triggers.open_recordings import OpenRecordings
from glovecal_service.recorder.triggers.trigger import Trigger
from glovecal_service.rest.glove.answer import Recording

MOST_OWN = 64
"""Packets sent lately, known again where they come back by a broadcast."""


class Announcements:
    """``look`` again and again: gloves that are recorded at the same time are one recording."""

    def __init__(
        self,
        recordings: OpenRecordings,
        targets: Sequence[Endpoint],
        *,
        time_code: Callable[[], TimeCode | None] = lambda: None,
        tell: Callable[[str], None],
    ) -> None:
        """``time_code``: what runs now, by this computer's monotonic clock. Raises BadInput for a host that
        is not known. A recording that goes on already only ends."""
        self._recordings, self._time_code, self._tell = recordings, time_code, tell
        self._sockets = [(target, *_reached(target)) for target in targets]
        self._own: deque[tuple[int, bytes]] = deque(maxlen=MOST_OWN)
        self._going_on: str | None = _first_name(recordings.now()) if targets else None

    def close(self) -> None:
        for _, opened, _ in self._sockets:
            opened.close()

    def is_own(self, port: int, packet: bytes) -> bool:
        """Whether this process sent ``packet`` from ``port``."""
        return (port, packet) in self._own

    def look(self) -> None:
        """Send what has to be sent. Raises ServiceError where the service does not answer."""
        if not self._sockets:
            return
        name = _first_name(self._recordings.now())
        if name == self._going_on:
            return
        if self._going_on is not None:
            self._send("stop", self._going_on)
        if name is not None:
            self._send("start", name)
        self._going_on = name

    def _send(self, action: Literal["start", "stop"], name: str) -> None:
        code = self._time_code()
        label = "" if code is None else code.at(clock_s())
        trigger = Trigger(action, name, str(secrets.randbelow(2**31)), time_code=label)
        for target, opened, address in self._sockets:
            try:
                for number, packet in enumerate(target.form.packets(trigger)):
                    if number:
                        time.sleep(target.form.pause_s)
                    self._own.append((opened.getsockname()[1], packet))
                    opened.sendto(packet, address)
            except OSError as error:
                self._tell(f"{target}: {action} of {name} could not be sent: {error.strerror}.")
            else:
                self._tell(f"{target}: sent {action} of {name}.")


def _first_name(rows: Sequence[Recording]) -> str | None:
    """Of the recording that began first; None while there is none."""
    return min(rows, key=lambda row: row.requested_at).name if rows else None


def _reached(target: Endpoint) -> tuple[socket.socket, tuple]:
    """A socket that may broadcast, and the address."""
    try:
        family, kind, _, _, address = socket.getaddrinfo(target.host, target.port, type=socket.SOCK_DGRAM)[0]
    except OSError:
        raise BadInput(
            f"cannot send to {target}: there is no host {target.host!r}; give its address"
        ) from None
    opened = socket.socket(family, kind)
    opened.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
    opened.bind(("", 0))
    return opened, address
