"""Datagrams to one address: sent at once or not at all, whoever may be listening there."""

from __future__ import annotations

import socket

from glovecal_models.errors import BadInput


class DatagramSender:
    """Open until ``close``; a receiver may come and go."""

    def __init__(self, host: str, port: int) -> None:
        """Raises BadInput for a host that is not known."""
        try:
            family, kind, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        except OSError as error:
            raise BadInput(
                f"no computer {host!r} is known here; give its address: --to HOST:{port}"
            ) from error
        self._address = address
        self._socket = socket.socket(family, kind)
        self._socket.setblocking(False)

    def send(self, message: bytes) -> bool:
        """Whether it has left this program."""
        try:
            return self._socket.sendto(message, self._address) == len(message)
        except OSError:  # the system's buffer is full, or there is no way there now
            return False

    def close(self) -> None:
        self._socket.close()
