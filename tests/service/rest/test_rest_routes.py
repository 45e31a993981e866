"""An application that is given routes as they are asked for answers as one that has all of them."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from fastapi import FastAPI
from starlette.routing import BaseRoute, Match
from starlette.types import Scope

from glovecal_service.rest.http.observation import PREFIX
from glovecal_service.rest.routes import NOUNS, add_answering, routers


def asked_scopes() -> Iterator[Scope]:
    """One request of each route below ``/v1``."""
    for prefix, router in routers():
        for route in router.routes if prefix else ():
            path = prefix + getattr(route, "path").format_map(Anything())  # noqa: B009
            for method in sorted(getattr(route, "methods")):  # noqa: B009
                yield {"type": "http", "method": method, "path": path, "root_path": "", "headers": []}


class Anything(dict[str, str]):
    def __missing__(self, name: str) -> str:
        return "something"


def answering(routes: list[BaseRoute], scope: Scope) -> object:
    for route in routes:
        match, child = route.matches(dict(scope))
        if match is Match.FULL:
            return child.get("endpoint") or child
    return None


@pytest.fixture(scope="module")
def whole() -> FastAPI:
    app = FastAPI()
    for prefix, router in routers():
        app.include_router(router, prefix=prefix)
    return app


def test_each_request_is_answered_by_the_same(whole: FastAPI) -> None:
    scopes = list(asked_scopes())
    assert len(scopes) > 100
    for scope in scopes:
        growing = FastAPI(openapi_url=None, docs_url=None, redoc_url=None)
        add_answering(growing, scope)
        found = answering(growing.router.routes, scope)
        assert found is not None
        assert found == answering(whole.router.routes, scope), scope


def test_a_request_gives_no_more_than_it_asks_for() -> None:
    app = FastAPI(openapi_url=None, docs_url=None, redoc_url=None)
    scope = {"type": "http", "method": "GET", "path": f"{PREFIX}/takes", "root_path": "", "headers": []}
    add_answering(app, scope)
    once = list(app.router.routes)
    add_answering(app, scope)
    assert app.router.routes == once
    add_answering(app, scope | {"path": f"{PREFIX}/no-such-word"})
    assert app.router.routes == once
    assert answering(once, scope | {"method": "POST", "path": f"{PREFIX}/takes/examination"}) is None


def test_every_route_begins_with_the_word_it_is_listed_under() -> None:
    listed = {noun for noun, names in NOUNS.items() if names}
    there = {
        getattr(route, "path").split("/")[1]  # noqa: B009
        for prefix, router in routers()
        for route in router.routes
        if prefix
    }
    assert there == listed
