"""Where an emulated glove is reached: a computer in the network; for a pseudo-terminal see its module."""

from __future__ import annotations

import contextlib
import select
import socket
from typing import Protocol


class Port(Protocol):
    """One end of a link. ``plug`` and ``unplug`` may alternate; reading and writing never block for long."""

    name: str

    def plug(self) -> None: ...

    def unplug(self) -> None: ...

    def handle(self) -> int | None:
        """A file descriptor to wait for, None while nothing can come."""
        ...

    def read(self) -> bytes: ...

    def write(self, data: bytes) -> bool:
        """False when it could not leave."""
        ...


class TcpDialer:
    """Connects to a computer, again and again until it is let in, as wireless gloves do."""

    def __init__(self, host: str, port: int) -> None:
        self.name = f"tcp:{host}:{port}"
        self._address = host, port
        self._plugged = False
        self._connection: socket.socket | None = None

    def plug(self) -> None:
        self._plugged = True
        self.handle()

    def unplug(self) -> None:
        self._plugged = False
        self._drop()

    def handle(self) -> int | None:
        if self._plugged and self._connection is None:
            with contextlib.suppress(OSError):
                self._connection = socket.create_connection(self._address, timeout=1.0)
                self._connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                if self._connection.getsockname() == self._connection.getpeername():
                    self._drop()  # on one computer a dialer can reach itself where nobody listens
        return self._connection.fileno() if self._connection else None

    def read(self) -> bytes:
        if self._connection is None or not wait([self._connection.fileno()], 0):
            return b""  # asked again: this may be a new connection under the old one's number
        try:
            data = self._connection.recv(4096)
        except OSError:
            data = b""
        if not data:  # the computer hung up
            self._drop()
        return data

    def write(self, data: bytes) -> bool:
        try:
            if self._connection is None:
                return False
            self._connection.sendall(data)
        except OSError:
            self._drop()
            return False
        return True

    def _drop(self) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None


class UdpSender:
    """Sends datagrams to a computer; what nobody hears is lost."""

    def __init__(self, host: str, port: int) -> None:
        self.name = f"udp:{host}:{port}"
        self._address = host, port
        self._socket: socket.socket | None = None

    def plug(self) -> None:
        if self._socket is None:
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._socket.setblocking(False)

    def unplug(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def handle(self) -> int | None:
        return self._socket.fileno() if self._socket else None

    def read(self) -> bytes:
        with contextlib.suppress(OSError):  # "connection refused" of an earlier datagram
            return self._socket.recv(4096) if self._socket else b""
        return b""

    def write(self, data: bytes) -> bool:
        with contextlib.suppress(OSError):
            return bool(self._socket and self._socket.sendto(data, self._address) == len(data))
        return False


def wait(handles: list[int], timeout_s: float) -> list[int]:
    """Those of ``handles`` that can be read."""
    try:
        return select.select(handles, [], [], timeout_s)[0]
    except (OSError, ValueError):  # unplugged while waiting
        return []
