"""Where a glove's bytes come from: a serial port, a TCP connection that the glove opens, or UDP datagrams.

An address is a port's path (``/dev/ttyUSB0``, ``COM3``), ``tcp:PORT``, ``tcp:HOST:PORT`` or the same with
``udp``. PORT is one of this computer, at which it waits for the glove; HOST is the address of this computer
at which it listens. Without one nobody in the network is heard, only programs of this computer.
"""

from __future__ import annotations

import contextlib
import select
import socket
import time
import weakref
from typing import Protocol

from glovecal_client.capture.serial_link import SerialLink
from glovecal_client.errors import BadOption, DeviceLost, reason_of
from glovecal_client.operating_system import listen_alone

LOOPBACK = "127.0.0.1"
_AT_MOST = 65536
_DIAL_IN_S = 1.0
"""How long one opening waits for a glove to connect; the port stays open between openings."""
_MOST_SILENT = 64
"""Connections that say nothing; the oldest goes when there are more."""


class Link(Protocol):
    """An open way to a glove. Its methods raise DeviceLost once the glove is gone."""

    def read(self, timeout_s: float) -> bytes:
        """What has come, waiting up to ``timeout_s`` for a first byte; empty if nothing did."""
        ...

    def write(self, data: bytes) -> None: ...

    def close(self) -> None: ...


class Place(Protocol):
    """Where a glove is expected."""

    name: str
    silent_s: float
    """Silence, in seconds, after which a glove counts as lost, at its fastest."""

    def open(self) -> Link:
        """Raises DeviceLost when nothing is there."""
        ...

    def close(self) -> None:
        """Stop waiting there; harmless when already closed."""
        ...


def place_of(address: str, baud: int, device: str) -> Place:
    """The place written as ``address``. Raises BadOption; ``device`` is named in it."""
    kind, colon, rest = address.partition(":")
    if not address:
        raise BadOption(
            f"{device}: say where the glove is, as in {device}:/dev/ttyUSB0 or {device}:tcp:65432"
        )
    if not colon or kind not in ("tcp", "udp"):
        return SerialPlace(address, baud)
    host, _, port = rest.rpartition(":")
    if not (port.isascii() and port.isdigit() and 0 < int(port) < 65536):
        raise BadOption(f"{device}: {address!r} needs a port from 1 to 65535, as in {kind}:65432")
    return (TcpPlace if kind == "tcp" else UdpPlace)(host or LOOPBACK, int(port))


class SerialPlace:
    """A serial port at one baud rate."""

    silent_s: float = 0.4

    def __init__(self, path: str, baud: int) -> None:
        self.name = path
        self._baud = baud

    def open(self) -> Link:
        return SerialLink(self.name, self._baud)

    def close(self) -> None:
        """Nothing waits at a serial port."""


class TcpPlace:
    """A port at which a glove connects: in wireless gloves the glove is the client.

    The port stays open when a glove is lost, so that one that connects only once is not turned away. Whoever
    speaks first has it: others that connected and say nothing do not keep it out. A glove may wait to be
    asked, so where nobody speaks the newest silent one is tried.
    """

    silent_s: float = 5.0
    """Wireless networks pause; a connection that was closed is seen at once."""

    def __init__(self, host: str, port: int) -> None:
        self.name: str = f"tcp:{host}:{port}"
        self._address = host, port
        self._listener: socket.socket | None = None
        self._silent: list[socket.socket] = []
        """Connected and not heard yet, oldest first."""
        weakref.finalize(self, _close_all, self._silent)

    def open(self) -> Link:
        listener = self._listening()
        until = time.monotonic() + _DIAL_IN_S
        while ready := select.select([listener, *self._silent], [], [], max(0.0, until - time.monotonic()))[
            0
        ]:
            if listener in ready:
                self._accept(listener)
            for connection in [one for one in self._silent if one in ready]:
                self._silent.remove(connection)
                if _speaks(connection):
                    return self._link(connection)
                connection.close()
        if not self._silent:
            raise DeviceLost(
                f"no glove has connected to {self.name} yet: is it switched on, and is this computer's "
                f"address in its settings?{_only_here(self._address[0])}"
            )
        return self._link(self._silent.pop())

    def _listening(self) -> socket.socket:
        if self._listener is None:
            self._listener = _bound(self.name, self._address, socket.SOCK_STREAM)
            self._listener.listen(_MOST_SILENT)
            weakref.finalize(self, self._listener.close)
        return self._listener

    def _accept(self, listener: socket.socket) -> None:
        self._silent.append(listener.accept()[0])
        if len(self._silent) > _MOST_SILENT:
            self._silent.pop(0).close()

    def _link(self, connection: socket.socket) -> Link:
        try:
            peer = connection.getpeername()[0]
        except OSError as error:
            connection.close()
            raise DeviceLost(f"{self.name}: the glove that connected is gone already") from error
        return _TcpLink(connection, f"{self.name} (glove at {peer})")

    def close(self) -> None:
        _close_all(self._silent)
        if self._listener is not None:
            self._listener.close()
            self._listener = None


def _speaks(connection: socket.socket) -> bool:
    """Whether something came from a connection that ``select`` found ready; False: it was closed."""
    try:
        return bool(connection.recv(1, socket.MSG_PEEK))
    except OSError:
        return False


def _close_all(connections: list[socket.socket]) -> None:
    while connections:
        connections.pop().close()


class _TcpLink:
    def __init__(self, connection: socket.socket, name: str) -> None:
        self._connection = connection
        self._name = name
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def read(self, timeout_s: float) -> bytes:
        try:
            if not select.select([self._connection], [], [], timeout_s)[0]:
                return b""
            data = self._connection.recv(_AT_MOST)
        except (OSError, ValueError) as error:
            raise DeviceLost(f"{self._name} is gone ({reason_of(error)})") from error
        if not data:
            raise DeviceLost(f"{self._name} closed its connection: switched off, or out of reach?")
        return data

    def write(self, data: bytes) -> None:
        try:
            self._connection.sendall(data)
        except OSError as error:
            raise DeviceLost(f"{self._name} is gone ({reason_of(error)})") from error

    def close(self) -> None:
        self._connection.close()


class UdpPlace:
    """A port to which a glove sends datagrams. A glove is there when one has come."""

    silent_s: float = 0.4

    def __init__(self, host: str, port: int) -> None:
        self.name: str = f"udp:{host}:{port}"
        self._address = host, port

    def open(self) -> Link:
        link = _UdpLink(_bound(self.name, self._address, socket.SOCK_DGRAM))
        deadline = time.monotonic() + _DIAL_IN_S
        while not link.heard and time.monotonic() < deadline:
            link.heard = link.read(_DIAL_IN_S)
        if not link.heard:
            link.close()
            raise DeviceLost(
                f"nothing comes to {self.name}: does the glove send to this computer's address?"
                f"{_only_here(self._address[0])}"
            )
        return link

    def close(self) -> None:
        """Nothing waits between openings: the next datagram comes anyway."""


class _UdpLink:
    """Each datagram ends with a line feed, added where it is missing: lines do not run over datagrams."""

    def __init__(self, port: socket.socket) -> None:
        self._port = port
        self._peer: tuple[str, int] | None = None
        self.heard = b""

    def read(self, timeout_s: float) -> bytes:
        if self.heard:
            data, self.heard = self.heard, b""
            return data
        try:
            if not select.select([self._port], [], [], timeout_s)[0]:
                return b""
            data, peer = self._port.recvfrom(_AT_MOST)
        except ConnectionResetError:  # Windows: what was sent to the glove before met a closed port
            return b""
        except (OSError, ValueError) as error:
            raise DeviceLost(f"nothing can be received any more ({reason_of(error)})") from error
        if self._peer not in (None, peer):
            return b""  # another sender: the glove is the one that was heard first
        self._peer = peer
        return data if data.endswith(b"\n") else data + b"\n"

    def write(self, data: bytes) -> None:
        if self._peer is not None:
            with contextlib.suppress(OSError):  # as with any datagram: it may not arrive
                self._port.sendto(data, self._peer)

    def close(self) -> None:
        self._port.close()


def _only_here(host: str) -> str:
    """What somebody with a wireless glove has to know."""
    if host != LOOPBACK:
        return ""
    return " For a glove in the network name this computer's address there, as in tcp:192.168.1.20:65432."


def _bound(name: str, address: tuple[str, int], kind: socket.SocketKind) -> socket.socket:
    opened = socket.socket(socket.AF_INET, kind)
    try:
        if kind == socket.SOCK_STREAM:
            listen_alone(opened)
        opened.bind(address)
    except OSError as error:
        opened.close()
        raise DeviceLost(
            f"cannot listen at {name} ({reason_of(error)}): is another program using this port?"
        ) from error
    return opened
