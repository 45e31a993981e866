"""Which methods a path answers to: Starlette's own 405 names those of one route only (RFC 9110, 10.2.1)."""

from __future__ import annotations

from collections.abc import Iterable

from fastapi import APIRouter
from starlette.routing import Route, compile_path


class AllowedMethods:
    """Called with a path, gives the methods of all routes that match it, sorted; each router has its prefix.

    The routes with the fewest parameters are the ones its path means: ``models/train`` is no model's id.
    """

    def __init__(self, routers: Iterable[tuple[str, APIRouter]]) -> None:
        self._routes = [
            (compile_path(prefix + route.path)[0], frozenset(route.methods or ()))
            for prefix, router in routers
            for route in router.routes
            if isinstance(route, Route)
        ]

    def __call__(self, path: str) -> list[str]:
        found = [(pattern, methods) for pattern, methods in self._routes if pattern.match(path)]
        fewest = min((pattern.groups for pattern, _ in found), default=0)
        return sorted(frozenset().union(*(each for pattern, each in found if pattern.groups == fewest)))
