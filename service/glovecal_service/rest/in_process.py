"""The same REST client and application in one process: every verb works without a running server."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress

import anyio
import httpx
from anyio.from_thread import BlockingPortal, start_blocking_portal
from starlette.types import ASGIApp, Message

from glovecal_client.rest import RestClient
from glovecal_service.rest.app import create_app
from glovecal_service.rest.routes import Growing
from glovecal_service.settings import Settings

URL = "http://localhost"
PARTS_AHEAD = 4


@contextmanager
def in_process_client(settings: Settings) -> Iterator[RestClient]:
    """A client of an application that works on the local data folder, its job dispatcher included.

    The application lives on an event loop in a thread of its own, until the block ends. Raises what
    opening the store raises.
    """
    app = create_app(settings, of_one_command=True)
    with (
        start_blocking_portal() as portal,
        portal.wrap_async_context_manager(app.router.lifespan_context(app)),
        RestClient(URL, transport=PortalTransport(Growing(app), portal), patience_s=3600.0) as client,
    ):
        yield client


class PortalTransport(httpx.BaseTransport):
    """Carries requests of a synchronous client to an ASGI application on a portal's event loop.

    An answer is handed over part by part as the application makes it, ``PARTS_AHEAD`` of them in advance.
    """

    def __init__(self, app: ASGIApp, portal: BlockingPortal) -> None:
        self._app = app
        self._portal = portal

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        assert isinstance(request.stream, httpx.SyncByteStream)
        asked = _Asked(self._app, request, iter(request.stream))
        task = self._portal.start_task_soon(asked.run)
        start = self._portal.call(asked.next_message)
        if start is None:
            task.result()
            return httpx.Response(500)
        answer = _Answer(self._portal, asked, task)
        if request.method == "HEAD":
            for _ in answer:
                pass
            answer.close()
            return httpx.Response(start["status"], headers=start.get("headers", []))
        return httpx.Response(start["status"], headers=start.get("headers", []), stream=answer)


class _Asked:
    """One request while the application answers it."""

    def __init__(self, app: ASGIApp, request: httpx.Request, body: Iterator[bytes]) -> None:
        self._app, self._request, self._body = app, request, body
        self._sent, self._given = anyio.create_memory_object_stream[Message](PARTS_AHEAD)
        self._gone = anyio.Event()
        self._is_read = False

    async def run(self) -> None:
        """Until it is answered; an application that fails has said so in its answer, or breaks that off."""
        url = self._request.url
        scope = {
            "type": "http", "asgi": {"version": "3.0"}, "http_version": "1.1",
            "method": self._request.method, "scheme": url.scheme, "path": url.path,
            "raw_path": url.raw_path.split(b"?")[0], "query_string": url.query, "root_path": "",
            "headers": [(name.lower(), value) for name, value in self._request.headers.raw],
            "server": (url.host, url.port), "client": ("127.0.0.1", 123),
        }  # fmt: skip
        async with self._sent:
            with suppress(Exception):
                await self._app(scope, self._receive, self._send)

    async def next_message(self) -> Message | None:
        """None when there are no more."""
        try:
            return await self._given.receive()
        except anyio.EndOfStream:
            return None

    async def leave(self) -> None:
        """Nobody reads the rest of the answer."""
        self._gone.set()
        self._given.close()

    async def _receive(self) -> Message:
        if self._is_read:
            await self._gone.wait()
            return {"type": "http.disconnect"}
        part = next(self._body, None)  # of a local file: quick enough for the loop's own thread
        self._is_read = part is None
        return {"type": "http.request", "body": part or b"", "more_body": part is not None}

    async def _send(self, message: Message) -> None:
        with suppress(anyio.BrokenResourceError):  # nobody reads it any more, as a server has it
            await self._sent.send(message)


class _Answer(httpx.SyncByteStream):
    def __init__(self, portal: BlockingPortal, asked: _Asked, task: Future[None]) -> None:
        self._portal, self._asked, self._task = portal, asked, task

    def __iter__(self) -> Iterator[bytes]:
        while (message := self._portal.call(self._asked.next_message)) is not None:
            if part := message.get("body", b""):
                yield part
            if not message.get("more_body", False):
                return
        raise httpx.RemoteProtocolError("the application broke the answer off")

    def close(self) -> None:
        """Waits for what the application does after its answer."""
        self._portal.call(self._asked.leave)
        self._task.result()
