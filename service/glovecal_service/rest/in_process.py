"""The same REST client and application in one process: every verb works without a running server."""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager

import httpx
from anyio.from_thread import BlockingPortal, start_blocking_portal
from fastapi import FastAPI

from glovecal_client.rest import RestClient
from glovecal_service.rest.app import create_app
from glovecal_service.settings import Settings

URL = "http://localhost"


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
        RestClient(URL, transport=PortalTransport(app, portal), patience_s=3600.0) as client,
    ):
        yield client


class PortalTransport(httpx.BaseTransport):
    """Carries requests of a synchronous client to an ASGI application on a portal's event loop.

    An answer is handed over when it is complete, so server-sent events would come at their end only: ask
    for the job instead.
    """

    def __init__(self, app: FastAPI, portal: BlockingPortal) -> None:
        self._asgi = httpx.ASGITransport(app, raise_app_exceptions=False)
        self._portal = portal

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        return self._portal.call(self._answer, request)

    async def _answer(self, request: httpx.Request) -> httpx.Response:
        assert isinstance(request.stream, httpx.SyncByteStream)
        carried = httpx.Request(
            request.method, request.url, headers=request.headers, stream=_Chunks(request.stream)
        )
        answer = await self._asgi.handle_async_request(carried)
        content = b"".join([part async for part in _parts(answer)])
        return httpx.Response(answer.status_code, headers=answer.headers, content=content)


class _Chunks(httpx.AsyncByteStream):
    """A request body that is read from a local file: quick enough for the loop's own thread."""

    def __init__(self, stream: httpx.SyncByteStream) -> None:
        self._stream = stream

    async def __aiter__(self) -> AsyncIterator[bytes]:
        for chunk in self._stream:
            yield chunk


async def _parts(answer: httpx.Response) -> AsyncIterator[bytes]:
    assert isinstance(answer.stream, httpx.AsyncByteStream)
    async for part in answer.stream:
        yield part
