"""A port on this computer to which datagrams are sent."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

Value = TypeVar("Value")
DEADLINE_S = 240.0


@contextmanager
def datagrams() -> Iterator[tuple[str, Callable[[], bytes]]]:
    """Address to send to, and what gives the next datagram, waiting for it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        opened.bind(("127.0.0.1", 0))
        opened.settimeout(120)
        yield f"127.0.0.1:{opened.getsockname()[1]}", lambda: opened.recv(65536)


def first(receive: Callable[[], bytes], read: Callable[[bytes], Value | None], what: str) -> Value:
    """What ``read`` gives of the first datagram of which it gives anything; no datagram waits for it."""
    end = time.monotonic() + DEADLINE_S
    while not (value := read(receive())):
        assert time.monotonic() < end, f"did not come in {DEADLINE_S} s: {what}"
    return value
