"""Test support: zenoh on free loopback ports, and waiting for a condition with a deadline."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TypeVar

from free_ports import free_endpoint as free_endpoint

from glovecal_client import Frame

Value = TypeVar("Value")


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
