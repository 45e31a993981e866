"""What every error looks like on the wire: a problem document (RFC 9457), named in OpenAPI by each operation.

Lists go on without damaged rows; each of those is named in a ``Warning`` header of the answer.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from http import HTTPStatus
from typing import Any, TypeVar

from fastapi import FastAPI, Response
from fastapi.openapi.utils import get_openapi
from pydantic import BaseModel, ConfigDict, Field
from starlette.routing import BaseRoute

from glovecal_service.plain import plain, plain_text
from glovecal_service.store.errors import DamagedRows

MEDIA_TYPE = "application/problem+json"


class FieldProblem(BaseModel):
    """One wrong field; the value given is never repeated."""

    location: str = Field(description="Where, such as `body.readings.0.3`.")
    problem: str = Field(description="What is wrong and what would be right.")


class ProblemDocument(BaseModel):
    """The body of every answer of 400 or more."""

    model_config = ConfigDict(extra="allow")

    type: str = Field(description="`urn:glovecal:problem:...`, stable: branch on this.")
    title: str = Field(description="The same words for every problem of this type.")
    status: int
    detail: str = Field(description="One sentence: the thing, the value, what would be right.")
    request_id: str | None = Field(None, description="The id in the service's log.")
    errors: list[FieldProblem] | None = Field(None, description="For 422: each wrong field.")
    file: str | None = Field(None, description="For a take table: the file's name.")
    line: int | None = Field(None, description="For a take table: the line, 1 is the header.")
    column: str | None = Field(None, description="For a take table: the column.")
    value: Any = Field(None, description="For a take table: the cell's text.")


class Problem(Exception):
    """An answer of 400 or more, raised anywhere below the routers."""

    def __init__(
        self,
        status: int,
        kind: str,
        detail: str,
        *,
        title: str | None = None,
        headers: Mapping[str, str] | None = None,
        **extensions: Any,
    ) -> None:
        super().__init__(detail)
        self.status = status
        self.kind = kind
        self.title = title or HTTPStatus(status).phrase
        self.detail = detail
        self.headers = dict(headers or {})
        self.extensions = extensions

    def document(self, request_id: str | None = None) -> dict[str, Any]:
        members: dict[str, Any] = {
            "type": f"urn:glovecal:problem:{self.kind}",
            "title": self.title,
            "status": self.status,
            "detail": plain_text(self.detail),
        }
        if request_id:
            members["request_id"] = request_id
        extensions = {name: value for name, value in self.extensions.items() if value is not None}
        return members | plain(extensions)

    def response(self, request_id: str | None = None) -> Response:
        return Response(
            json.dumps(self.document(request_id), allow_nan=False),
            status_code=self.status,
            media_type=MEDIA_TYPE,
            headers={"Cache-Control": "no-store", **self.headers},
        )


Record = TypeVar("Record")
MOST_WARNINGS = 20
LONGEST_WARNING = 400


def without_damaged(response: Response, read: Callable[[], list[Record]]) -> list[Record]:
    """What ``read`` gives, or of damaged rows the sound ones, with the others named in the answer."""
    try:
        return read()
    except DamagedRows as error:
        warn_of_damaged(response, error.damaged)
        return error.sound


def warn_of_damaged(response: Response, sentences: Sequence[str]) -> None:
    for sentence in sentences[:MOST_WARNINGS]:
        warn(response, sentence)


def warn(response: Response, sentence: str) -> None:
    """A header ``Warning: 299 glovecal "..."`` (RFC 7234, section 5.5: a persistent warning)."""
    quoted = plain_text(sentence, LONGEST_WARNING).encode("ascii", "backslashreplace").decode()
    quoted = quoted.replace("\\", "\\\\").replace('"', '\\"')
    response.headers.append("Warning", f'299 glovecal "{quoted}"')


_MEANING = {
    401: "The service asks who you are, and no valid key was sent.",
    403: "The key's role may not do this, or a page of another site asked for a change.",
    404: "There is no such thing (or the path is not a plain name).",
    408: "The body came too slowly.",
    409: "It contradicts what is stored.",
    413: "The body is too large.",
    415: "The body is of a type this does not read.",
    421: "The Host header names another computer.",
    422: "The request cannot be used; `errors` or `file`, `line`, `column` say where.",
    429: "The same key or person asks too often; `Retry-After` says when to ask again.",
    500: "A stored file is damaged, or the service failed; details are in its log under `request_id`.",
    503: "The database does not answer, or the service is not ready.",
    507: "The disk is full; nothing was kept.",
}
_ANYWHERE = (401, 403, 404, 421, 422, 429, 500, 503)
_CHANGING = (408, 413, 507)


def problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """``responses=`` of an operation that only reads: the usual problems and ``statuses``."""
    return {status: _documented(status) for status in sorted({*_ANYWHERE, *statuses})}


def change_problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """``responses=`` of an operation that changes something or has a body."""
    return problems(*_CHANGING, *statuses)


def install_openapi(
    app: FastAPI,
    routes: Callable[[], list[BaseRoute]],
    bodies: Callable[[], Iterable[type[BaseModel]]],
) -> None:
    """Of all ``routes``, with the components that are referred to by hand: ``Problem``, and ``bodies`` that
    are read by hand."""

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            schema = get_openapi(
                title=app.title,
                version=app.version,
                description=app.description,
                routes=routes(),
                tags=app.openapi_tags,
            )
            schemas = schema.setdefault("components", {}).setdefault("schemas", {})
            models: dict[str, type[BaseModel]] = {"Problem": ProblemDocument}
            models |= {body.__name__: body for body in bodies()}
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
