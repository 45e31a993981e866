"""Each request seen from outside: its id, one log line, its metrics (for Prometheus, in a registry of the
application's own), and no traceback to the client.
"""

from __future__ import annotations

import logging
import re
import secrets
import time

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from glovecal_service.logs import Event
from glovecal_service.plain import plain_text
from glovecal_service.rest.http.problem import Problem

METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "DELETE", "OPTIONS", "PATCH"})


class Metrics:
    """Counters and histograms; label values come from closed sets, so that no client can grow them."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        self.requests = Counter(
            "glovecal_http_requests",
            "Answered requests.",
            ["method", "route", "status"],
            registry=self.registry,
        )
        self.seconds = Histogram(
            "glovecal_http_request_seconds",
            "From the first header to the last byte of the answer.",
            ["route"],
            buckets=(0.001, 0.005, 0.02, 0.1, 0.5, 2.0, 10.0, 60.0),
            registry=self.registry,
        )
        self.uploaded_bytes = Counter(
            "glovecal_uploaded_bytes", "Bytes of uploads that were kept.", registry=self.registry
        )
        self.imported_takes = Counter("glovecal_imported_takes", "Takes imported.", registry=self.registry)
        self.predicted_frames = Counter(
            "glovecal_rest_predicted_frames", "Frames predicted over REST.", registry=self.registry
        )
        self.jobs = Gauge("glovecal_jobs", "Jobs in the database.", ["state"], registry=self.registry)

    def answered(self, method: str, route: str, status: int, seconds: float) -> None:
        known = method if method in METHODS else "other"
        self.requests.labels(known, route, str(status)).inc()
        self.seconds.labels(route).observe(seconds)

    def text(self) -> bytes:
        """All of it in the Prometheus text format."""
        return generate_latest(self.registry)


PREFIX = "/v1"
# ours: asgi-correlation-id 5.0.1 replaces 7 lines here by 10 of set-up, and logs a warning for each bad id
REQUEST_ID = re.compile(r"[A-Za-z0-9_-]{8,64}\Z")

SESSION_COOKIE = "glovecal_session"
"""Of a browser in which somebody logged in."""
STUDIO = "studio"
"""How the client is called in requests that its pages make, before the browser's address, and where they are:
looking there again and again fills no log."""
OFTEN = (f"{PREFIX}/cameras/{{glove}}/picture", f"{PREFIX}/recordings")
"""Routes asked for ten times a second: by each page that shows a camera's picture, and by
``glovecal trigger`` that waits for recordings to begin."""
_log = logging.getLogger("glovecal.rest")


class Observation:
    """ASGI middleware, the outermost. Logs neither headers, queries nor bodies: secrets live there."""

    def __init__(self, app: ASGIApp, *, metrics: Metrics) -> None:
        self.app = app
        self.metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        request_id = _request_id(scope)
        scope.setdefault("state", {})["request_id"] = request_id
        answer = _Answer(send, request_id)
        began = time.perf_counter()
        try:
            await self.app(scope, receive, answer.send)
        except Exception:
            _log.exception("%s", Event("request failed", {}, request_id=request_id, route=_route(scope)))
            await _answer_failure(answer, scope, receive, request_id)
        finally:
            self._note(scope, answer, request_id, time.perf_counter() - began)

    def _note(self, scope: Scope, answer: _Answer, request_id: str, seconds: float) -> None:
        route = _route(scope)
        self.metrics.answered(scope["method"], route, answer.status, seconds)
        for_a_page = (scope.get("client") or ("",))[0].startswith(STUDIO) or scope["path"].startswith(
            f"/{STUDIO}/"
        )
        only_looks = (for_a_page or route in OFTEN) and scope["method"] == "GET" and answer.status < 400
        request = Event(
            "request",
            {"path": plain_text(scope["path"], 200)},
            request_id=request_id,
            method=plain_text(scope["method"], 20),
            route=route,
            status=answer.status,
            ms=round(1e3 * seconds, 2),
            sent_bytes=answer.sent_bytes,
        )
        _log.log(logging.DEBUG if only_looks else logging.INFO, "%s", request)


class _Answer:
    def __init__(self, send: Send, request_id: str) -> None:
        self._send = send
        self._request_id = request_id.encode()
        self.status = 0
        self.sent_bytes = 0

    async def send(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            self.status = message["status"]
            added = [(b"x-request-id", self._request_id), (b"x-content-type-options", b"nosniff")]
            message = {**message, "headers": [*message.get("headers", []), *added]}
        self.sent_bytes += len(message.get("body", b""))
        await self._send(message)


async def _answer_failure(answer: _Answer, scope: Scope, receive: Receive, request_id: str) -> None:
    if answer.status:
        raise ConnectionAbortedError("the answer broke off; see the log line before")
    problem = Problem(
        500, "failure", f"Something failed inside the service; its log has it under request id {request_id}."
    )
    await problem.response(request_id)(scope, receive, answer.send)


def _request_id(scope: Scope) -> str:
    for name, value in scope["headers"]:
        if name == b"x-request-id" and REQUEST_ID.match(given := value.decode("latin-1")):
            return given
    return secrets.token_hex(8)


def _route(scope: Scope) -> str:
    """The route's pattern. Some versions of FastAPI leave the prefix of an included router out of it."""
    path = getattr(scope.get("route"), "path", None)
    if path is None:
        return "unmatched"
    return path if path.startswith(PREFIX) or not scope["path"].startswith(PREFIX) else PREFIX + path
