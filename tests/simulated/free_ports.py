"""Ports at which nobody else begins to listen between the asking and the listening.

Asked for any port the system gives one of those from which it also makes connections: by the time a service
listens there, another test's may do so, and answer in its place. Each process of pytest has ports of its own
below those, and gives each of them once.
"""

from __future__ import annotations

import itertools
import os
import re
import socket

FIRST, EACH, PROCESSES = 12_000, 1_000, 20
_WORKER = int((re.findall(r"\d+", os.environ.get("PYTEST_XDIST_WORKER", "")) or ["0"])[0]) % PROCESSES
_places = itertools.count(os.getpid())
"""Another run on the same computer begins elsewhere."""


def free_port() -> int:
    """On 127.0.0.1, for TCP and UDP."""
    for place in itertools.islice(_places, EACH):
        port = FIRST + EACH * _WORKER + place % EACH
        if _is_free(port):
            return port
    raise OSError(
        f"none of the {EACH} ports from {FIRST + EACH * _WORKER} on is free; end what listens there"
    )


def free_endpoint() -> str:
    """A tcp endpoint of zenoh."""
    return f"tcp/127.0.0.1:{free_port()}"


def _is_free(port: int) -> bool:
    for kind in (socket.SOCK_STREAM, socket.SOCK_DGRAM):
        with socket.socket(socket.AF_INET, kind) as tried:
            try:
                tried.bind(("127.0.0.1", port))
            except OSError:
                return False
    return True
