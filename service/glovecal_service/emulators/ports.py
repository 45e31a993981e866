"""Where an emulated glove is reached: a pseudo-terminal, or a computer in the network."""

from __future__ import annotations

import contextlib
import os
import select
import socket
from pathlib import Path
from typing import Protocol

from glovecal_models.errors import BadInput


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


class PseudoTerminal:
    """A serial port under the name ``link``, a symbolic link that outlives re-plugging. POSIX only."""

    def __init__(self, link: Path) -> None:
        """Raises BadInput where the name is taken, or where there are no pseudo-terminals."""
        if not hasattr(os, "openpty"):
            raise BadInput("this computer has no pseudo-terminals; use --tcp or --udp")
        if link.exists() or link.is_symlink():
            raise BadInput(f"{link} exists already: another emulator, or name a new port with --port")
        self.name = str(link)
        self._link = link
        self._ends: tuple[int, int] | None = None

    def plug(self) -> None:
        if self._ends is None:
            import tty

            ours, theirs = os.openpty()
            tty.setraw(theirs)
            os.set_blocking(ours, False)
            self._ends = ours, theirs
            self._link.symlink_to(os.ttyname(theirs))

    def unplug(self) -> None:
        """The port vanishes: whoever has it open gets an error."""
        if self._ends is not None:
            self._link.unlink(missing_ok=True)
            for end in self._ends:
                os.close(end)
            self._ends = None

    def handle(self) -> int | None:
        return self._ends[0] if self._ends else None

    def read(self) -> bytes:
        with contextlib.suppress(OSError):
            return os.read(self._ends[0], 4096) if self._ends else b""
        return b""

    def write(self, data: bytes) -> bool:
        """What does not fit is lost, as in a serial port that nobody reads."""
        if self._ends is None:
            return False
        with contextlib.suppress(OSError):
            return os.write(self._ends[0], data) == len(data)
        return False


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
