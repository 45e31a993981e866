"""A port on this computer to which datagrams are sent."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def datagrams() -> Iterator[tuple[str, Callable[[], bytes]]]:
    """Address to send to, and what gives the next datagram, waiting for it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        opened.bind(("127.0.0.1", 0))
        opened.settimeout(120)
        yield f"127.0.0.1:{opened.getsockname()[1]}", lambda: opened.recv(65536)
