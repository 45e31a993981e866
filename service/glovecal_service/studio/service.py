"""The service as the studio sees it: the routes of REST, called in the same process.

Whatever a page shows, a script can ask for; every check and refusal of REST holds for pages too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, Generic, TypeVar
from weakref import WeakKeyDictionary, WeakSet

import httpx
from fastapi import FastAPI
from nicegui import Client, context, ui
from nicegui.slot import Slot

from glovecal_client.list_part import TOTAL
from glovecal_service.plain import read
from glovecal_service.rest.http.observation import SESSION_COOKIE, STUDIO

PATIENCE_S = 300.0
UNKNOWN = 401
"""Status of a request of whom nobody knows who asks."""
Found = TypeVar("Found")
_BROWSERS: WeakKeyDictionary[Slot, _Browser] = WeakKeyDictionary()
"""Of the parts of pages that asked for something: a part may clear itself and go on asking."""


class Refusal(Exception):
    """The service refused; ``str()`` is its sentence for a user."""

    def __init__(self, status: int, sentence: str) -> None:
        super().__init__(sentence)
        self.status = status


warn = partial(ui.notify, type="warning")
warn_long = partial(warn, timeout=10_000)


@contextmanager
def refusals(tell: Callable[[str], object] = warn) -> Iterator[None]:
    """What the service refuses inside is told, and the rest of the block is not done."""
    try:
        yield
    except Refusal as refusal:
        if not is_session_over():
            tell(str(refusal))


@dataclass(frozen=True)
class _Browser:
    """Who opened a page: what the page asks is asked by them."""

    session: str | None = None
    address: str = ""

    @classmethod
    def here(cls) -> _Browser:
        if not context.slot_stack:
            return cls()
        part = context.slot
        try:
            request = context.client.request
            if request is not None:
                address = request.client.host if request.client else ""
                _BROWSERS[part] = cls(request.cookies.get(SESSION_COOKIE), address)
        except RuntimeError:
            pass  # the part of the page in which this began was cleared since it asked first
        return _BROWSERS.get(part, cls())

    @property
    def origin(self) -> str:
        """As the log of changes has it."""
        return f"{STUDIO} {self.address}".rstrip()


def has_session() -> bool:
    """Whether somebody logged in to see this page."""
    return _Browser.here().session is not None


_WITHOUT_SESSION: WeakSet[Client] = WeakSet()
"""Pages that have said it."""
LOG_IN = '() => location.assign("../login?page=" + encodeURIComponent(location.pathname + location.search))'


def is_session_over() -> bool:
    """Whether this page's service answers nobody any more: the page says so."""
    return _client() in _WITHOUT_SESSION


def _say_that_session_is_over() -> None:
    client = _client()
    if client is None or client in _WITHOUT_SESSION:
        return
    _WITHOUT_SESSION.add(client)
    with client, ui.dialog(value=True).props('persistent aria-label="Session over"'), ui.card():
        ui.label("Your session has ended. Log in to go on; what is not saved on this page is lost.")
        log_in = ui.button("Log in").props("unelevated no-caps color=indigo-8")
        log_in.on("click", js_handler=LOG_IN)  # the page reaches the service no more


def _client() -> Client | None:
    """None in a part of a page that was cleared, and outside pages."""
    try:
        return context.client if context.slot_stack else None
    except RuntimeError:
        return None


_ORIGIN = "origin"


class _InProcess(httpx.AsyncBaseTransport):
    """To the application, each request from the browser for which a page asks."""

    def __init__(self, app: FastAPI) -> None:
        self._app = app

    async def handle_async_request(self, request: httpx.Request) -> httpx.Response:
        client = (request.extensions[_ORIGIN], 0)
        transport = httpx.ASGITransport(self._app, raise_app_exceptions=False, client=client)
        return await transport.handle_async_request(request)


@dataclass(frozen=True)
class Part(Generic[Found]):
    rows: list[Found]
    after: str | None
    """Where the next part begins; None: there is none."""
    total: int | None
    """Rows of all parts; None: they were not counted."""


class Service:
    """Paths are below ``/v1``: ``await service.get("/takes", subject="anna")``; answers are plain data."""

    def __init__(self, app: FastAPI) -> None:
        self._http = httpx.AsyncClient(
            base_url="http://localhost/v1", transport=_InProcess(app), timeout=PATIENCE_S, trust_env=False
        )

    async def get(self, path: str, **query: Any) -> Any:
        return await self._ask("GET", path, query)

    async def part(self, answer: type[Found], path: str, **query: Any) -> Part[Found]:
        """Rows of a list: ``limit`` of them, after the place ``after``."""
        found = await self._answer("GET", path, query)
        following = httpx.URL(found.links.get("next", {}).get("url", "")).params.get("after")
        total = found.headers.get(TOTAL)
        return Part(read(list[answer], found.json()), following, None if total is None else int(total))

    async def every(self, answer: type[Found], path: str, **query: Any) -> list[Found]:
        """All rows of a list that is not long: of one person, or of what is going on."""
        part = await self.part(answer, path, **query)
        rows = part.rows
        while part.after is not None:
            part = await self.part(answer, path, **query, after=part.after)
            rows += part.rows
        return rows

    async def read(self, answer: type[Found], path: str, **query: Any) -> Found:
        """What ``get`` answers, as what it is."""
        return read(answer, await self.get(path, **query))

    async def post(self, path: str, body: Mapping[str, Any] | None = None, **query: Any) -> Any:
        return await self._ask("POST", path, query, body or {})

    async def ask(self, answer: type[Found], path: str, body: Mapping[str, Any] | None = None) -> Found:
        """What ``post`` answers, as what it is."""
        return read(answer, await self.post(path, body))

    async def put(self, path: str, body: Mapping[str, Any], **query: Any) -> Any:
        return await self._ask("PUT", path, query, body)

    async def put_file(self, path: str, content: bytes, media_type: str, **query: Any) -> Any:
        return await self._ask("PUT", path, query, None, content, media_type)

    async def post_file(self, path: str, content: bytes, media_type: str, **query: Any) -> Any:
        return await self._ask("POST", path, query, None, content, media_type)

    async def delete(self, path: str, **query: Any) -> Any:
        return await self._ask("DELETE", path, query, None)

    async def close(self) -> None:
        await self._http.aclose()

    async def _ask(self, *request: Any) -> Any:
        answer = await self._answer(*request)
        return answer.json() if answer.content else None

    async def _answer(
        self,
        method: str,
        path: str,
        query: Mapping[str, Any],
        body: Mapping[str, Any] | None = None,
        content: bytes | None = None,
        media_type: str = "",
    ) -> httpx.Response:
        """Raises Refusal."""
        given = {name: value for name, value in query.items() if value is not None}
        browser = _Browser.here()
        headers = {"Cookie": f"{SESSION_COOKIE}={browser.session}"} if browser.session else {}
        answer = await self._http.request(
            method, path, params=given, json=body, content=content,
            headers=headers | ({"Content-Type": media_type} if media_type else {}),
            extensions={_ORIGIN: browser.origin},
        )  # fmt: skip
        if answer.is_success:
            return answer
        try:
            problem = answer.json()
        except ValueError:
            problem = {}
        sentence = str(
            problem.get("detail") or problem.get("title") or f"The service answered {answer.status_code}."
        )
        if answer.status_code == UNKNOWN and browser.session:
            _say_that_session_is_over()
        raise Refusal(answer.status_code, sentence)
