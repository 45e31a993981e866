"""What answers below ``/v1``, by the first word of an address: all of it in a service; in the process of a
single command only what that command asks for, since most of the modules would be loaded in vain."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from itertools import chain

from fastapi import APIRouter, FastAPI
from starlette.routing import BaseRoute, Match
from starlette.types import Receive, Scope, Send

from glovecal_service.rest.http.observation import PREFIX

NOUNS: Mapping[str, tuple[str, ...]] = {
    "subjects": ("subject.subjects", "asking"),
    "erasures": ("subject.erasures",),
    "skeleton": ("subject.usual_hand",),
    "gloves": ("glove.layouts",),
    "live-gloves": ("glove.live",),
    "glove-commands": ("glove.commands",),
    "recordings": ("glove.recordings",),
    "films": ("glove.films",),
    "cameras": ("glove.cameras",),
    "camera-files": ("glove.camera_files",),
    "sampling": ("sampling.samplings",),
    "serial-ports": ("glove.connecting",),
    "glove-devices": ("glove.connecting",),
    "simulated-glove": ("first_run.simulated_glove",),
    "hidden-effects": ("first_run.hidden_effects",),
    "takes": (
        "take.session_drift",
        "take.takes",
        "take.clocks",
        "take.hands",
        "take.series",
        "take.table_import",
        "take.reference",
        "take.reference_import",
        "asking",
    ),
    "uploads": ("take.uploads", "take.dropped"),
    "motion": ("take.motion",),
    "videos": ("take.videos",),
    "models": (
        "model.model_import",
        "model.vendor_calibrations",
        "model.refinement",
        "model.models",
        "model.predictions",
        "model.comparison",
        "sampling.next_steps",
        "model.residuals",
        "effect.picture",
        "model.fall",
        "effect.trial",
        "asking",
    ),
    "improve": ("asking",),
    "effects": ("effect.catalogue",),
    "jobs": ("job.jobs",),
    "overview": ("overview.overview",),
    "health": ("http.health",),
    "metrics": ("http.health",),
    "keys": ("access.keys",),
    "people": ("access.people",),
    "audit": ("access.audit",),
}
"""Modules below this package, each with a ``router``. Those of one word are loaded one after another until
one of them answers, so that a word in an address comes before what takes any word in its place; what loads
most comes last."""


MODULES = tuple(dict.fromkeys(chain(*NOUNS.values())))
"""Each once."""


def routers() -> list[tuple[str, APIRouter]]:
    """All there are, each with the beginning of its addresses."""
    from glovecal_service.rest.access import login, provider_login
    from glovecal_service.rest.http import health

    pages = [("", router) for router in (health.pages, login.router, provider_login.router)]
    return [*pages, *((PREFIX, _router(name)) for name in MODULES)]


@cache
def every_route() -> list[BaseRoute]:
    """Of all applications in a process: what a route takes is worked out slowly."""
    every = APIRouter()
    for prefix, router in routers():
        every.include_router(router, prefix=prefix)
    return every.routes


class Growing:
    """An application without routes, which is given what answers a request when one comes."""

    def __init__(self, app: FastAPI) -> None:
        self.app = app
        self.given: list[str] = []
        """Of ``MODULES``."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        self.grow(scope)
        await self.app(scope, receive, send)

    def grow(self, scope: Scope) -> None:
        noun = f"{scope['path']}/".removeprefix(f"{PREFIX}/").partition("/")[0]
        for name in NOUNS.get(noun, ()):
            if any(route.matches(scope)[0] is Match.FULL for route in self.app.router.routes):
                return
            if name not in self.given:
                self.app.include_router(_router(name), prefix=PREFIX)
                self.given.append(name)


def _router(name: str) -> APIRouter:
    return import_module(f"glovecal_service.rest.{name}").router
