"""An application that is given routes as they are asked for answers as one that has all of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from fastapi import APIRouter, FastAPI
from starlette.routing import Match
from starlette.types import Scope

from glovecal_service.rest.http.observation import PREFIX
from glovecal_service.rest.routes import MODULES, NOUNS, Growing, routers


def asked() -> Iterator[tuple[Scope, object]]:
    """One request of each route below ``/v1``, and the function that is to answer it."""
    for prefix, router in routers():
        for route in map(vars, router.routes if prefix else ()):
            path = prefix + route["path"].format_map(Anything())
            for method in sorted(route["methods"]):
                scope = {"type": "http", "method": method, "path": path, "root_path": "", "headers": []}
                yield scope, route["endpoint"]


class Anything(dict[str, str]):
    def __missing__(self, name: str) -> str:
        return "something"


def answering(asked: Iterable[APIRouter], scope: Scope) -> object:
    """The function that is called, of the first route that takes the request; None where none does."""
    below = {**scope, "path": scope["path"].removeprefix(PREFIX)}
    every = (route for router in asked for route in router.routes)
    return next((vars(route)["endpoint"] for route in every if route.matches(below)[0] is Match.FULL), None)


def growing() -> Growing:
    return Growing(FastAPI(openapi_url=None, docs_url=None, redoc_url=None))


def routers_of(app: Growing) -> list[APIRouter]:
    return [vars(each)["original_router"] for each in app.app.router.routes]


def test_each_route_answers_what_is_asked_of_it() -> None:
    """None is hidden by one before it, such as ``takes/session-drift`` by ``takes/{id}``."""
    whole = [router for prefix, router in routers() if prefix]
    requests = list(asked())
    assert len(requests) > 100
    for scope, endpoint in requests:
        app = growing()
        app.grow(scope)
        assert answering(whole, scope) is endpoint, scope
        assert answering(routers_of(app), scope) is endpoint, scope


def test_a_request_gives_no_more_than_it_asks_for() -> None:
    app = growing()
    scope = {"type": "http", "method": "GET", "path": f"{PREFIX}/takes", "root_path": "", "headers": []}
    app.grow(scope)
    app.grow(scope)
    app.grow({**scope, "path": f"{PREFIX}/no-such-word"})
    assert app.given == ["take.session_drift", "take.takes"]


def test_nothing_is_given_twice() -> None:
    app = growing()
    for scope, _ in asked():
        app.grow(scope)
        app.grow({**scope, "method": "BREW"})
    assert sorted(app.given) == sorted(MODULES)
    assert len(routers_of(app)) == len(MODULES)


def test_every_route_begins_with_the_word_it_is_listed_under() -> None:
    there = {
        vars(route)["path"].split("/")[1] for prefix, router in routers() for route in router.routes if prefix
    }
    assert there == set(NOUNS)
