"""OpenAPI of the error answers: every operation says which problems it can give."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from pydantic import BaseModel

from glovecal_service.rest.http.problem import MEDIA_TYPE, ProblemDocument

_MEANING = {
    403: "A page of another site asked for a change.",
    404: "There is no such thing (or the path is not a plain name).",
    408: "The body came too slowly.",
    409: "It contradicts what is stored.",
    413: "The body is too large.",
    415: "The body is of a type this does not read.",
    421: "The Host header names another computer.",
    422: "The request cannot be used; `errors` or `file`, `line`, `column` say where.",
    500: "A stored file is damaged, or the service failed; details are in its log under `request_id`.",
    503: "The database does not answer, or the service is not ready.",
    507: "The disk is full; nothing was kept.",
}
_ANYWHERE = (404, 421, 422, 500, 503)
_CHANGING = (403, 408, 413, 507)


def problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """``responses=`` of an operation that only reads: the usual problems and ``statuses``."""
    return {status: _documented(status) for status in sorted({*_ANYWHERE, *statuses})}


def change_problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """``responses=`` of an operation that changes something or has a body."""
    return problems(*_CHANGING, *statuses)


def install_openapi(app: FastAPI, *bodies: type[BaseModel]) -> None:
    """Add the components that are referred to by hand: ``Problem``, and ``bodies`` that are read by hand."""

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            schema = get_openapi(
                title=app.title,
                version=app.version,
                description=app.description,
                routes=app.routes,
                tags=app.openapi_tags,
            )
            schemas = schema.setdefault("components", {}).setdefault("schemas", {})
            models: dict[str, type[BaseModel]] = {"Problem": ProblemDocument}
            models |= {body.__name__: body for body in bodies}
            for name, model in models.items():
                component = model.model_json_schema(ref_template="#/components/schemas/{model}")
                schemas.update(component.pop("$defs", {}))
                schemas[name] = component
            for unused in ("HTTPValidationError", "ValidationError"):
                schemas.pop(unused, None)
            app.openapi_schema = schema
        return app.openapi_schema

    app.openapi = openapi


def _documented(status: int) -> dict[str, Any]:
    reference = {"$ref": "#/components/schemas/Problem"}
    return {"description": _MEANING[status], "content": {MEDIA_TYPE: {"schema": reference}}}
