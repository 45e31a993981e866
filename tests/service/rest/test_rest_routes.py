"""An application that is given routes as they are asked for answers as one that has all of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from fastapi import APIRouter, FastAPI
from starlette.routing import Match
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


def answering(asked: Iterable[APIRouter], scope: Scope) -> object:
    """The function that is called, of the first route that takes the request; None where none does."""
    below = scope | {"path": scope["path"].removeprefix(PREFIX)}
    every = (route for router in asked for route in router.routes)
    return next((vars(route)["endpoint"] for route in every if route.matches(below)[0] is Match.FULL), None)


def given(app: FastAPI) -> list[APIRouter]:
    return [vars(each)["original_router"] for each in app.router.routes]


def bare() -> FastAPI:
    return FastAPI(openapi_url=None, docs_url=None, redoc_url=None)


def test_each_request_is_answered_by_the_same() -> None:
    whole = [router for prefix, router in routers() if prefix]
    scopes = list(asked_scopes())
    assert len({answering(whole, scope) for scope in scopes}) > 100
    for scope in scopes:
        growing = bare()
        add_answering(growing, scope)
        assert answering(given(growing), scope) == answering(whole, scope) is not None, scope


def test_a_request_gives_no_more_than_it_asks_for() -> None:
    app = bare()
    scope = {"type": "http", "method": "GET", "path": f"{PREFIX}/takes", "root_path": "", "headers": []}
    add_answering(app, scope)
    once = given(app)
    add_answering(app, scope)
    add_answering(app, scope | {"path": f"{PREFIX}/no-such-word"})
    assert given(app) == once
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
