"""What every error looks like on the wire: a problem document (RFC 9457)."""

from __future__ import annotations

import json
from collections.abc import Mapping
from http import HTTPStatus
from typing import Any

from pydantic import BaseModel, ConfigDict, Field
from starlette.responses import Response

from glovecal_service.plain import plain, plain_text

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
