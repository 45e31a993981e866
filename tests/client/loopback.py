"""Test support: zenoh on free loopback ports, and waiting for a condition with a deadline."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from typing import TypeVar

Value = TypeVar("Value")


def free_endpoint() -> str:
    """A tcp endpoint on 127.0.0.1 that nobody listens on."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{listener.getsockname()[1]}"


def eventually(condition: Callable[[], Value | None], what: str, deadline_s: float = 120.0) -> Value:
    """The first true value of ``condition``; fails with ``what`` after the deadline."""
    end = time.monotonic() + deadline_s
    while not (value := condition()):
        assert time.monotonic() < end, f"did not happen in {deadline_s} s: {what}"
        time.sleep(0.01)
    return value
