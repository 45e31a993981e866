"""Requests that no router should see: hostile paths, pages of other sites, bodies too large or too slow.

The browser is a way in: any page can make it send requests to this service, and a host name that an
attacker points at its address (DNS rebinding) makes such a page same-origin. So only loopback names and
those that the service is known by are answered, and a changing request of another origin is refused.

Neither Starlette nor uvicorn bounds the time of a body (trust.md 2.4: 200 half-sent requests still open
after 12 s), so its bytes and its time are bounded here, below the framework: the body is counted as it
passes, and an answer the application tries to give after a bound was broken is replaced by 413 or 408.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Container
from urllib.parse import urlsplit

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from glovecal_client.hosts import is_loopback
from glovecal_service.rest.http.problem import Problem
from glovecal_service.settings import Settings

SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})
LONGEST_PATH = 1024


class RequestGuard:
    """ASGI middleware: 404 for paths that are not plain, 421 for foreign hosts, 403 for foreign origins."""

    def __init__(self, app: ASGIApp, *, hosts: Container[str] = ()) -> None:
        """``hosts``: names that are answered beside those of loopback."""
        self.app = app
        self.hosts = hosts

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        problem = self._problem(scope)
        if problem is None:
            await self.app(scope, receive, send)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
        else:
            await problem.response(scope.get("state", {}).get("request_id"))(scope, receive, send)

    def _problem(self, scope: Scope) -> Problem | None:
        headers = {name: value.decode("latin-1") for name, value in scope["headers"]}
        if not _is_plain_path(scope["path"], scope.get("raw_path") or b""):
            return Problem(404, "not-found", "There is nothing under this path.")
        host = headers.get(b"host", "")
        name = _host_name(host)
        if not is_loopback(name) and name not in self.hosts:
            return Problem(
                421,
                "foreign-host",
                "This service does not answer to that name. Use one that stands in its certificate, or have "
                "the name added to GLOVECAL_ALLOWED_HOSTS.",
            )
        if _changes_something(scope) and not _same_origin(headers, host):
            return Problem(403, "foreign-origin", "A page of another site may not change anything here.")
        return None


def asks_who(settings: Settings) -> bool:
    """Whether whoever asks has to prove who they are. A proxy on this computer lets others in, too."""
    return settings.login == "always" or not is_loopback(settings.host) or bool(settings.known_proxies)


def _is_plain_path(path: str, raw_path: bytes) -> bool:
    if len(path) > LONGEST_PATH or any(ord(letter) < 0x20 or ord(letter) == 0x7F for letter in path):
        return False
    if "\\" in path or b"%2f" in raw_path.lower():
        return False
    return not {".", ".."} & set(path.split("/"))


def _host_name(host: str) -> str:
    try:
        return urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return ""


def _changes_something(scope: Scope) -> bool:
    return scope["type"] == "websocket" or scope["method"] not in SAFE_METHODS


def _same_origin(headers: dict[bytes, str], host: str) -> bool:
    if headers.get(b"sec-fetch-site", "none") not in ("same-origin", "none"):
        return False
    origin = headers.get(b"origin")
    if origin is None:
        return True
    try:
        return urlsplit(origin).netloc.lower() == host.lower()
    except ValueError:
        return False


LINGER_S = 2.0
"""After a refusal the rest of the body is thrown away for this long, so that a client that is still
sending reads the answer instead of a reset connection."""


class BodyGuard:
    """ASGI middleware: 413 above ``limit(path)`` bytes, 408 when the body is late.

    A body may take ``patience_s`` in all, plus one second per ``slowest_bytes_per_s`` received: a large
    upload over a slow line is fine, one byte now and then is not (Apache's mod_reqtimeout, MinRate).
    """

    def __init__(
        self,
        app: ASGIApp,
        *,
        limit: Callable[[str], int],
        patience_s: float = 30.0,
        slowest_bytes_per_s: float = 64e3,
    ) -> None:
        self.app = app
        self.limit = limit
        self.patience_s = patience_s
        self.slowest_bytes_per_s = slowest_bytes_per_s

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        body = _Body(receive, self.limit(scope["path"]), self.patience_s, self.slowest_bytes_per_s)
        declared = _content_length(scope)
        if declared is not None and declared > body.limit:
            await _refuse(body.too_large(), scope, receive, send)
            return
        answer = _Answer(send, body)
        try:
            await self.app(scope, body.receive, answer.send)
        except Exception:
            if body.broken is None or answer.started:
                raise
        if body.broken is not None and not answer.started:
            await _refuse(body.broken, scope, receive, send)


class _Body:
    """The request body on its way in, counted and timed."""

    def __init__(self, receive: Receive, limit: int, patience_s: float, slowest_bytes_per_s: float) -> None:
        self._receive = receive
        self._slowest = slowest_bytes_per_s
        self._patience_s = patience_s
        self._since = time.monotonic()
        self._complete = False
        self.limit = limit
        self.received = 0
        self.broken: Problem | None = None

    async def receive(self) -> Message:
        if self.broken is not None:
            return {"type": "http.disconnect"}
        if self._complete:
            return await self._receive()
        try:
            async with asyncio.timeout(self._seconds_left()):
                message = await self._receive()
        except TimeoutError:
            return self._stop(self.too_slow())
        self.received += len(message.get("body", b""))
        self._complete = not message.get("more_body", False)
        return self._stop(self.too_large()) if self.received > self.limit else message

    def _seconds_left(self) -> float:
        allowed = self._patience_s + self.received / self._slowest
        return max(0.0, self._since + allowed - time.monotonic())

    def _stop(self, problem: Problem) -> Message:
        self.broken = problem
        return {"type": "http.disconnect"}

    def too_large(self) -> Problem:
        return Problem(
            413,
            "body-too-large",
            f"The body is larger than the {_size(self.limit)} allowed here; nothing was kept.",
            limit_bytes=self.limit,
            headers={"Connection": "close"},
        )

    def too_slow(self) -> Problem:
        return Problem(
            408,
            "body-too-slow",
            f"Only {self.received} bytes of the body came in {self._patience_s:g} s; nothing was kept.",
            headers={"Connection": "close"},
        )


class _Answer:
    """Holds back whatever the application says after its body was cut off."""

    def __init__(self, send: Send, body: _Body) -> None:
        self._send = send
        self._body = body
        self.started = False

    async def send(self, message: Message) -> None:
        if self._body.broken is not None and not self.started:
            return
        self.started = True
        await self._send(message)


def _content_length(scope: Scope) -> int | None:
    for name, value in scope["headers"]:
        if name == b"content-length":
            return int(value) if value.isdigit() and len(value) < 20 else None
    return None


async def _refuse(problem: Problem, scope: Scope, receive: Receive, send: Send) -> None:
    response = problem.response(scope.get("state", {}).get("request_id"))
    await send({"type": "http.response.start", "status": problem.status, "headers": response.raw_headers})
    await send({"type": "http.response.body", "body": response.body, "more_body": True})
    if problem.status == 413:
        await _throw_away(receive)
    await send({"type": "http.response.body", "body": b"", "more_body": False})


async def _throw_away(receive: Receive) -> None:
    try:
        async with asyncio.timeout(LINGER_S):
            while True:
                message = await receive()
                if message["type"] == "http.disconnect" or not message.get("more_body", False):
                    return
    except TimeoutError:
        return


def _size(count: int) -> str:
    return f"{count / 1e6:g} MB" if count >= 1e6 else f"{count / 1e3:g} kB"
