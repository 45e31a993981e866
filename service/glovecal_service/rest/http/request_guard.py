"""Requests that no router should see: hostile paths, and pages of other sites using the user's browser.

Without logins the browser is the way in: any page can make it send requests to 127.0.0.1, and a host
name that an attacker points at 127.0.0.1 (DNS rebinding) makes such a page same-origin. So, while bound
to loopback, only loopback names are answered, and a changing request of another origin is refused.
"""

from __future__ import annotations

import ipaddress
from urllib.parse import urlsplit

from starlette.types import ASGIApp, Receive, Scope, Send

from glovecal_service.rest.http.problem import Problem

SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})
LONGEST_PATH = 1024


class RequestGuard:
    """ASGI middleware: 404 for paths that are not plain, 421 for foreign hosts, 403 for foreign origins."""

    def __init__(self, app: ASGIApp, *, loopback_only: bool) -> None:
        self.app = app
        self.loopback_only = loopback_only

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
        if self.loopback_only and not is_loopback(_host_name(host)):
            return Problem(
                421,
                "foreign-host",
                "This service answers to localhost and 127.0.0.1 only; set GLOVECAL_HOST to serve others.",
            )
        if _changes_something(scope) and not _same_origin(headers, host):
            return Problem(403, "foreign-origin", "A page of another site may not change anything here.")
        return None


def is_loopback(host: str) -> bool:
    """Whether ``host`` (a name or an address, no port) means this computer."""
    if host.lower().rstrip(".") == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


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
