"""Commands to a glove from elsewhere, such as "record on your card", carried out between two readings.

Asked on ``glovecal/<site>/<glove>/control?do=NAME;with=ARGUMENT``; the reply is the device's document.
"""

from __future__ import annotations

import json
import queue
from collections.abc import Callable, Mapping
from typing import Any

import zenoh

from glovecal_client.capture.device import Device
from glovecal_client.errors import ClientError, DeviceLost, reason_of
from glovecal_client.keys import JSON_ENCODING
from glovecal_client.names import did_you_mean
from glovecal_client.queries import REFUSAL_ENCODING

MOST_WAITING = 8


class GloveCommands:
    """Taken by zenoh's threads, carried out by the capture thread: one device, one thread."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._queue: queue.Queue[zenoh.Query] = queue.Queue(MOST_WAITING)

    @property
    def waiting(self) -> bool:
        """Whether ``carry_out`` has something to do."""
        return not self._queue.empty()

    def take(self, query: zenoh.Query) -> None:
        """Let a command wait; refused at once when too many do or the glove has none."""
        commands = getattr(self._device, "commands", {})
        name = str(query.parameters.get("do", ""))
        if not commands:
            _refuse(query, f"{self._device.name} is only listened to: it has no commands")
        elif name not in commands:
            meant = did_you_mean(name, commands)
            _refuse(query, f"{self._device.name} has no command {name!r}; {meant}")
        else:
            try:
                self._queue.put_nowait(query)
            except queue.Full:
                _refuse(query, f"{MOST_WAITING} commands wait already; ask again")

    def carry_out(self, *, is_open: bool) -> None:
        """The oldest one. Raises DeviceLost when the glove is lost meanwhile."""
        query = self._queue.get_nowait()
        if not is_open:
            _refuse(query, f"{self._device.name} is not open: plug it in")
            return
        do: Callable[[str, str], Mapping[str, Any]] = self._device.command  # type: ignore[attr-defined]
        try:
            answer = do(str(query.parameters.get("do", "")), str(query.parameters.get("with", "")))
        except Exception as error:  # a device is foreign code, perhaps a user's own
            is_ours = isinstance(error, ClientError)
            _refuse(query, reason_of(error) if is_ours else f"{self._device.name}: {reason_of(error)}")
            if isinstance(error, DeviceLost):
                raise
            return
        with query:
            query.reply(query.key_expr, json.dumps(dict(answer)), encoding=JSON_ENCODING)

    def close(self) -> None:
        """Answer what waits still."""
        while self.waiting:
            _refuse(self._queue.get_nowait(), "capture has stopped")


def _refuse(query: zenoh.Query, sentence: str) -> None:
    with query:
        query.reply_err(sentence, encoding=REFUSAL_ENCODING)
