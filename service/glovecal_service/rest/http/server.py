"""Uvicorn as Glovecal runs it: bounded connections, deadlines for TLS and headers, a bounded shutdown."""

from __future__ import annotations

import asyncio
import socket
import ssl
from collections.abc import Sequence
from ipaddress import ip_address, ip_network
from typing import Any

import uvicorn
from uvicorn.loops.auto import auto_loop_factory
from uvicorn.protocols.http.h11_impl import H11Protocol

from glovecal_client.hosts import is_loopback

HEADER_DEADLINE_S = 10.0
"""A connection that has not sent complete headers by then is closed (slow-header attacks)."""
HANDSHAKE_DEADLINE_S = 5.0
"""A connection that has not agreed on TLS by then is closed; until it has, it counts as none of these:"""
MOST_CONNECTIONS = 512
MOST_OF_ONE_ADDRESS = 256
"""One computer keeps nobody else out, unless it is this one: a page's parts ask from here."""


class PatientH11Protocol(H11Protocol):
    """Uvicorn's HTTP/1.1 protocol, which by itself waits for headers for ever."""

    header_deadline_s = HEADER_DEADLINE_S
    _deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        _send_at_once(transport)
        if len(self.connections) > MOST_CONNECTIONS or self._is_one_too_many():
            transport.abort()
            return
        self._deadline = self.loop.call_later(self.header_deadline_s, self._give_up)

    def _is_one_too_many(self) -> bool:
        address = self.client[0] if self.client else ""
        if len(self.connections) <= MOST_OF_ONE_ADDRESS or is_loopback(address) or self._is_proxy(address):
            return False
        clients = (getattr(each, "client", None) for each in self.connections)
        return sum(client is not None and client[0] == address for client in clients) > MOST_OF_ONE_ADDRESS

    def _is_proxy(self, address: str) -> bool:
        """Behind one are many computers."""
        known = self.config.forwarded_allow_ips if self.config.proxy_headers else ()
        return any(ip_address(address) in ip_network(each) for each in known)

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if self._waits_for_headers():
            if self._deadline is None:
                self._deadline = self.loop.call_later(self.header_deadline_s, self._give_up)
        else:
            self._forget_deadline()

    def connection_lost(self, exc: Exception | None) -> None:
        self._forget_deadline()
        super().connection_lost(exc)

    def _waits_for_headers(self) -> bool:
        """Not where the connection has become a WebSocket, which is another protocol's from then on."""
        is_ours = self.transport.get_protocol() is self
        return is_ours and (self.cycle is None or self.cycle.response_complete)

    def _give_up(self) -> None:
        self._deadline = None
        if self._waits_for_headers() and not self.transport.is_closing():
            self.transport.abort()

    def _forget_deadline(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None


def _send_at_once(transport: asyncio.Transport) -> None:
    """TCP_NODELAY. asyncio sets it by itself only on sockets that name their protocol; without it each
    answer waits 40 ms for the acknowledgement of its headers."""
    connection = transport.get_extra_info("socket")
    if connection is not None and connection.family in (socket.AF_INET, socket.AF_INET6):
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


def new_event_loop() -> asyncio.AbstractEventLoop:
    """The loop that uvicorn chooses, whose servers wait for a TLS handshake for ``HANDSHAKE_DEADLINE_S``: by
    themselves they wait for a minute, and uvicorn has no setting for it."""
    chosen = auto_loop_factory()()
    chosen.close()
    kind: Any = type(chosen)

    class Loop(kind):
        async def create_server(self, *args: Any, ssl: Any = None, **more: Any) -> Any:
            if ssl is not None:
                more["ssl_handshake_timeout"] = HANDSHAKE_DEADLINE_S
            return await super().create_server(*args, ssl=ssl, **more)

    return Loop()


def server_config(
    app: Any, host: str, port: int, context: ssl.SSLContext | None = None, proxies: Sequence[str] = ()
) -> uvicorn.Config:
    """The configuration to start ``uvicorn.Server`` with, for ``app`` from ``create_app``; with a ``context``
    it speaks TLS. ``proxies``: addresses and networks whose X-Forwarded-For and -Proto are believed.

    Server-sent events stay open for ever by design, hence the bound on the graceful shutdown. Logs go
    through ``logging`` as the process has set it up; the access log is the application's own.
    """
    return uvicorn.Config(
        app,
        host=host,
        port=port,
        http=PatientH11Protocol,
        loop=f"{__name__}:{new_event_loop.__name__}",
        log_config=None,
        ssl_context_factory=None if context is None else lambda *_: context,
        access_log=False,
        server_header=False,
        date_header=True,
        proxy_headers=bool(proxies),
        forwarded_allow_ips=list(proxies),
        ws_per_message_deflate=False,  # a live hand's floats hardly get shorter, thirty times a second
        timeout_keep_alive=15,
        timeout_graceful_shutdown=3,
        lifespan="on",
    )
