"""``/`` and ``/docs``: what this service is, and its API reference, both without anything from elsewhere.

Swagger UI comes from the package ``fastapi-offline``, of which only the files are used: its page holds an
inline script, which the Content-Security-Policy here does not let run.
"""

from __future__ import annotations

import base64
import hashlib
from importlib.resources import files
from typing import Literal

from fastapi import APIRouter, Response
from fastapi.responses import FileResponse, HTMLResponse

from glovecal_service.report.html import STYLE, render
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.health import SEEN_WITHIN_S, realtime_seen_s_ago, working_storage
from glovecal_service.rest.http.problem import Problem

router = APIRouter(include_in_schema=False)

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


@router.get("/")
def front(parts: PartsNeeded) -> HTMLResponse:
    """A page for whoever opens the service's address in a browser."""
    page = render("front.html", "the service", state=_state(parts), studio=parts.settings.studio)
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
        ("subjects", str(len(store.subjects.list()))),
        ("takes", str(len(store.takes.list()))),
        ("models", str(len(store.models.list()))),
        ("gloves seen", ", ".join(glove.name for glove in store.gloves.list()) or "none"),
    ]


@router.get("/docs")
def reference() -> HTMLResponse:
    """Swagger UI on the service's own OpenAPI document."""
    return HTMLResponse(REFERENCE, headers={"Content-Security-Policy": REFERENCE_POLICY})


@router.get("/docs/start.js")
def start() -> Response:
    return Response(START, media_type="text/javascript")


@router.get("/docs/{name}")
def asset(name: Literal["swagger-ui-bundle.js", "swagger-ui.css"]) -> FileResponse:
    return FileResponse(str(files("fastapi_offline") / "static" / name))
