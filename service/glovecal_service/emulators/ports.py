"""An emulated glove at a port, served by a thread of its own.

Here it is reached as a computer in the network; for a pseudo-terminal see its module.
"""

from __future__ import annotations

import contextlib
import select
import socket
import threading
import time
from typing import Protocol

from glovecal_service.emulators.glove import EmulatedGlove, Faults


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


_LONGEST_WAIT_S = 0.1


class Emulation:
    """Plugged in from ``with`` on; ``unplug`` and ``replug`` pull the cable."""

    def __init__(self, glove: EmulatedGlove, port: Port, faults: Faults | None = None) -> None:
        self.glove = glove
        self.port = port
        self.sendings = 0
        """How often something left."""
        self._faults = faults or Faults()
        self._lock = threading.Lock()
        self._pulled = False
        self._plugged = False
        self._running = True
        self._woken, self._wake = socket.socketpair()  # a pipe cannot be waited for on Windows
        self._thread = threading.Thread(target=self._serve, name="emulated-glove", daemon=True)

    def __enter__(self) -> Emulation:
        self._began_s = time.perf_counter()
        self._settle()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._running = False
        self._wake.send(b"x")
        self._thread.join(timeout=10)
        self._pulled = True
        self._settle()
        self._woken.close()
        self._wake.close()

    def unplug(self) -> None:
        """Pull the cable; the glove is without power until ``replug``."""
        self._pulled = True
        self._settle()

    def replug(self) -> None:
        """Plug it in again: a new start of the glove at a port of the same name."""
        self._pulled = False
        self._settle()
        self._wake.send(b"x")

    def _settle(self) -> None:
        """Plug in or pull out, as it should be now."""
        with self._lock:
            plugged = not (self._pulled or self._faults.unplugged(time.perf_counter() - self._began_s))
            if plugged and not self._plugged:
                self.glove.power_up()
                self.port.plug()
            elif self._plugged and not plugged:
                self.port.unplug()
            self._plugged = plugged

    def _serve(self) -> None:
        while self._running:
            self._settle()
            with self._lock:
                handle = self.port.handle() if self._plugged else None
                wait_s = _LONGEST_WAIT_S if handle is None else self.glove.next_due_s() - time.perf_counter()
            woken = self._woken.fileno()
            watched = [woken] if handle is None else [woken, handle]
            ready = wait(watched, min(_LONGEST_WAIT_S, max(0.0, wait_s)))
            if woken in ready:
                with contextlib.suppress(OSError):
                    self._woken.recv(64)
            with self._lock:
                if self._plugged and handle is not None and self.port.handle() == handle:
                    self._exchange(handle in ready)

    def _exchange(self, something_came: bool) -> None:
        heard = self.port.read() if something_came else b""
        now_s = time.perf_counter()
        for part in (self.glove.feed(heard, now_s), self.glove.due(now_s)):
            if part:
                self.sendings += self.port.write(part)
