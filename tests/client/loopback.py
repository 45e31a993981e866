"""Test support: zenoh on free loopback ports, and waiting for a condition with a deadline."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Sequence
from typing import TypeVar

from glovecal_client import Frame

Value = TypeVar("Value")


def free_endpoint() -> str:
    """A tcp endpoint on 127.0.0.1 that nobody listens on."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{listener.getsockname()[1]}"


def heard_of(published: Sequence[Frame], heard: Sequence[Frame]) -> list[Frame]:
    """Those of ``published`` that were heard: zenoh drops a put where the computer is busy."""
    numbers = {frame.sequence for frame in heard}
    return [frame for frame in published if frame.sequence in numbers]


def eventually(condition: Callable[[], Value | None], what: str, deadline_s: float = 120.0) -> Value:
    """The first true value of ``condition``; fails with ``what`` after the deadline."""
    end = time.monotonic() + deadline_s
    while not (value := condition()):
        assert time.monotonic() < end, f"did not happen in {deadline_s} s: {what}"
        time.sleep(0.01)
    return value
