"""Whether the process lives and can do its work, numbers for Prometheus, ``/`` and ``/docs`` for a browser.

The pages hold nothing from elsewhere. Swagger UI comes from the package ``fastapi-offline``, of which only
the files are used: its page holds an inline script, which the Content-Security-Policy here does not let run.
"""

from __future__ import annotations

import base64
import hashlib
import os
import shutil
import time
from importlib.resources import files
from pathlib import Path
from typing import Literal

from fastapi import APIRouter, Request, Response
from fastapi.responses import FileResponse, HTMLResponse
from markupsafe import Markup
from prometheus_client import CONTENT_TYPE_LATEST
from pydantic import BaseModel, Field

from glovecal_models.presentation.document import Column, Table
from glovecal_models.presentation.html import table_html
from glovecal_service.plain import reason_of
from glovecal_service.pulses import SEEN_WITHIN_S, Pulses, standing_still
from glovecal_service.report.html import STYLE, render
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.problem import Problem, problems
from glovecal_service.restarts import AWAY_TIMES, AWAY_WITHIN_S, TOLD_FOR_S, Restarts
from glovecal_service.store.blobs import LEAST_FREE_BYTES
from glovecal_service.store.errors import StoreError
from glovecal_service.store.store import Store

router = APIRouter(tags=["health"])

REALTIME_ALIVE = "realtime.alive"
"""A file in the data folder that the real-time process touches once a second."""
MOST_DAMAGES = 20
"""That are named; of more their number is."""


class Live(BaseModel):
    status: Literal["alive"] = "alive"
    processes_seen_s_ago: dict[str, float] = Field(
        description="Each process of `glovecal serve`; 503 where one gave no sign of life for 5 s."
    )


class Storage(BaseModel):
    database: str
    artifacts: str


class Ready(Storage):
    status: Literal["ready"] = "ready"
    realtime_seen_s_ago: float
    realtime_restarts: int = Field(description="In the last 10 minutes; 503 after three within one.")
    problems: list[str] = Field(
        description="What does not keep the service from working, such as a damaged model: what to do. "
        "Damage is looked for without end, and everything is looked at about once an hour."
    )


@router.get(
    "/health/live", summary="Every process of the service lives: real time, recorders, web",
    responses=problems(),
)  # fmt: skip
async def live(request: Request) -> Live:
    """503 with a sentence where one does not, which a restart cures. It asks neither database nor object
    store: without them gloves are served, and nothing is to be restarted. Nor does it wait for a thread:
    those that wait for a database may be all there are."""
    return Live(processes_seen_s_ago=_living(request.app.state.parts))


@router.get(
    "/health/ready", summary="Gloves are served: database, artifacts and real time work",
    responses=problems(507),
)  # fmt: skip
def ready(parts: PartsNeeded, response: Response) -> Ready:
    """503 or 507 with a sentence when they do not; the rest of REST answers without real time, too."""
    response.headers["Cache-Control"] = "no-store"
    storage = working_storage(parts)
    seen_s_ago = realtime_seen_s_ago(parts)
    if seen_s_ago is None or seen_s_ago > SEEN_WITHIN_S:
        raise Problem(503, "not-ready", _no_realtime(seen_s_ago))
    restarts = Restarts(parts.settings.data)
    if restarts.within(AWAY_WITHIN_S) >= AWAY_TIMES:
        raise Problem(503, "not-ready", f"gloves are served with interruptions: {restarts.sentence()}")
    _living(parts)
    told = [sentence for sentence in (restarts.sentence(),) if sentence]
    return Ready(
        **storage.model_dump(),
        realtime_seen_s_ago=seen_s_ago,
        realtime_restarts=restarts.within(TOLD_FOR_S),
        problems=[*told, *filter(None, [parts.store.files.waiting]), *_problems(parts.store)],
    )


@router.get(
    "/metrics",
    response_class=Response,
    summary="Numbers for Prometheus",
    responses=problems()
    | {200: {"description": "Text format.", "content": {"text/plain": {"schema": {"type": "string"}}}}},
)
def metrics(parts: PartsNeeded) -> Response:
    counts = parts.store.jobs.unfinished()
    for state in ("queued", "running"):
        parts.metrics.jobs.labels(state).set(counts.get(state, 0))
    return Response(parts.metrics.text(), media_type=CONTENT_TYPE_LATEST)


def working_storage(parts: Parts) -> Storage:
    """Raises Problem when database or artifacts do not work."""
    _check_database(parts.store)
    return Storage(
        database=parts.store.database.engine.dialect.name,
        artifacts=_check_artifacts(parts.store, parts.settings.data),
    )


def realtime_seen_s_ago(parts: Parts) -> float | None:
    """Seconds; None: never."""
    try:
        seen = (parts.settings.data / REALTIME_ALIVE).stat().st_mtime
    except OSError:
        return None
    return round(max(0.0, time.time() - seen), 1)


def _living(parts: Parts) -> dict[str, float]:
    seen_s_ago = Pulses(parts.settings.data).seen_s_ago()
    if sentence := standing_still(seen_s_ago):
        raise Problem(503, "not-alive", sentence)
    return seen_s_ago


def _no_realtime(seen_s_ago: float | None) -> str:
    seen = "was never seen" if seen_s_ago is None else f"was last seen {seen_s_ago:.0f} s ago"
    return f"no glove is served: the real-time process {seen}; glovecal serve's log says why"


def _check_database(store: Store) -> None:
    try:
        store.subjects.count()
    except StoreError as error:
        raise Problem(503, "not-ready", f"the database does not work: {error}") from error


def _check_artifacts(store: Store, data: Path) -> str:
    try:
        store.artifacts.exists("0" * 64)
    except (StoreError, OSError) as error:
        waiting = f"; {store.files.waiting}" if store.files.waiting else ""
        detail = f"the artifacts cannot be reached: {reason_of(error)}{waiting}"
        raise Problem(503, "not-ready", detail) from error
    if not os.access(data, os.W_OK):
        raise Problem(503, "not-ready", "the data folder cannot be written to")
    free = shutil.disk_usage(data).free
    if free < LEAST_FREE_BYTES:
        raise Problem(507, "storage-full", f"only {free / 1e6:.0f} MB are free; free some disk space")
    return f"{free / 1e9:.1f} GB free"


def _problems(store: Store) -> list[str]:
    try:
        known, total = store.damages.list(limit=MOST_DAMAGES)
    except StoreError as error:
        return [str(error)]
    more = total - len(known)
    return [damage.sentence for damage in known] + (
        [f"{more} more are damaged; the service's log names each"] if more else []
    )


pages = APIRouter(include_in_schema=False)

NOTHING_ELSE = "default-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
STYLE_HASH = base64.b64encode(hashlib.sha256(STYLE.encode()).digest()).decode()
FRONT_POLICY = f"{NOTHING_ELSE}; style-src 'sha256-{STYLE_HASH}'; img-src 'self'"
REFERENCE_POLICY = (
    f"{NOTHING_ELSE}; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
    "connect-src 'self'"
)
"""Swagger UI sets style attributes and draws with data: pictures."""
REFERENCE = """<!doctype html><html lang="en"><head><meta charset="utf-8">
<title>Glovecal: API reference</title><meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,"><link rel="stylesheet" href="docs/swagger-ui.css"></head>
<body><div id="reference"></div>
<script src="docs/swagger-ui-bundle.js"></script><script src="docs/start.js"></script></body></html>
"""
START = """SwaggerUIBundle({
  url: "v1/openapi.json", dom_id: "#reference", deepLinking: true, validatorUrl: null,
  docExpansion: "list", defaultModelsExpandDepth: -1,
});
"""


@pages.get("/")
def front(parts: PartsNeeded) -> HTMLResponse:
    """A page for whoever opens the service's address in a browser."""
    table = Table([Column(""), Column("")], _state(parts))
    page = render("front.html", "the service", state=Markup(table_html(table)), studio=parts.settings.studio)
    return HTMLResponse(page, headers={"Content-Security-Policy": FRONT_POLICY, "Cache-Control": "no-store"})


def _state(parts: Parts) -> list[tuple[str, str]]:
    try:
        storage = working_storage(parts)
    except Problem as problem:
        return [("state", f"not ready: {problem.detail}")]
    store, seen_s_ago = parts.store, realtime_seen_s_ago(parts)
    running = seen_s_ago is not None and seen_s_ago <= SEEN_WITHIN_S
    return [
        ("state", "ready" if running else "gloves are not served"),
        ("real-time process", "running" if running else "not seen"),
        ("database", f"{storage.database}, {storage.artifacts}"),
        ("subjects", str(store.subjects.count())),
        ("takes", str(store.takes.count())),
        ("models", str(store.models.count())),
        ("gloves seen", ", ".join(sorted(store.gloves.names())) or "none"),
    ]


@pages.get("/docs")
def reference() -> HTMLResponse:
    """Swagger UI on the service's own OpenAPI document."""
    return HTMLResponse(REFERENCE, headers={"Content-Security-Policy": REFERENCE_POLICY})


@pages.get("/docs/start.js")
def start() -> Response:
    return Response(START, media_type="text/javascript")


@pages.get("/docs/{name}")
def asset(name: Literal["swagger-ui-bundle.js", "swagger-ui.css"]) -> FileResponse:
    return FileResponse(str(files("fastapi_offline") / "static" / name))
