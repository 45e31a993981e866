"""From exceptions to problem documents: one place decides which error is which answer."""

from __future__ import annotations

import errno
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any

from fastapi import APIRouter, FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.responses import Response
from starlette.routing import Route, compile_path

from glovecal_client.errors import BadEncryptionKey, DamagedFile
from glovecal_models.errors import (
    BadInput,
    BadLayout,
    BadTakeTable,
    DamagedArtifact,
    GlovecalError,
    LayoutMismatch,
    NotTrainable,
)
from glovecal_models.names import did_you_mean
from glovecal_service.plain import plain_text
from glovecal_service.request_types import LONGEST_SHOWN, MEANING
from glovecal_service.rest.http.problem import Problem
from glovecal_service.store.errors import Conflict, NotFound, StorageFull, StoreDamaged, StoreUnavailable

MOST_FIELD_PROBLEMS = 20


def install_error_handlers(app: FastAPI) -> None:
    """Every error on purpose becomes its problem; the rest is caught by ``Observation``."""
    kinds = (Problem, HTTPException, RequestValidationError, ClientDisconnect, GlovecalError, OSError)
    for kind in kinds:
        app.add_exception_handler(kind, _answer)


async def _answer(request: Request, error: Exception) -> Response:
    if isinstance(error, HTTPException) and error.status_code == 405:
        error = _method_not_allowed(request.app.state.allowed_methods(request.url.path))
    return problem_of(error).response(getattr(request.state, "request_id", None))


def problem_of(error: Exception) -> Problem:
    """The problem an exception is answered with; re-raises what nobody raised on purpose."""
    match error:
        case Problem():
            return error
        case RequestValidationError():
            return invalid_request(error.errors())
        case HTTPException():
            return _http_problem(error)
        case NotFound():
            return Problem(404, "not-found", str(error))
        case Conflict():
            return Problem(409, "conflict", str(error))
        case StorageFull():
            return storage_full(str(error))
        case StoreDamaged() | DamagedArtifact() | DamagedFile():
            return Problem(500, "damaged", str(error), title="Damaged data")
        case StoreUnavailable():
            return Problem(503, "store-unavailable", str(error), headers={"Retry-After": "5"})
        case BadEncryptionKey():
            return Problem(503, "store-unavailable", str(error))
        case BadInput():
            return _bad_input(error)
        case ClientDisconnect():
            return Problem(408, "body-incomplete", "The connection ended before the body; nothing was kept.")
        case OSError() if error.errno in (errno.ENOSPC, errno.EDQUOT):
            return storage_full("The disk is full; nothing was kept. Free some space and send it again.")
    raise error


def invalid_request(errors: Sequence[Any]) -> Problem:
    """422 from pydantic's findings. Of the input names alone are shown: it may be huge, or secret."""
    fields = [
        {
            "location": plain_text(".".join(map(str, item["loc"])), 200),
            "problem": what_is_right(item),
        }
        for item in errors[:MOST_FIELD_PROBLEMS]
    ]
    more = f" and {len(errors) - 1} more" if len(errors) > 1 else ""
    first = f"{fields[0]['location']}: {fields[0]['problem']}" if fields else "the request is not valid"
    return Problem(422, "invalid-request", f"{first}{more}", errors=fields)


def storage_full(detail: str) -> Problem:
    return Problem(507, "storage-full", detail)


def _http_problem(error: HTTPException) -> Problem:
    headers = dict(error.headers or {})
    if error.status_code == 404:
        return Problem(404, "not-found", "There is nothing under this path.", headers=headers)
    if error.status_code == 400:
        return Problem(422, "invalid-request", "The body cannot be read as JSON (too deep, or not UTF-8).")
    return Problem(error.status_code, "http", str(error.detail), headers=headers)


def _method_not_allowed(methods: Sequence[str]) -> Problem:
    allowed = ", ".join(methods)
    return Problem(
        405, "method-not-allowed", f"This path answers to {allowed} only.", headers={"Allow": allowed}
    )


def _bad_input(error: BadInput) -> Problem:
    match error:
        case BadTakeTable():
            return Problem(
                422,
                "bad-take-table",
                str(error),
                title="Take table cannot be imported",
                file=error.file,
                line=error.line,
                column=error.column,
                value=error.value,
            )
        case BadLayout():
            return Problem(422, "bad-layout", str(error), title="Layout cannot be used")
        case LayoutMismatch():
            return Problem(422, "layout-mismatch", str(error), title="Layouts differ")
        case NotTrainable():
            return Problem(422, "not-trainable", str(error), title="Cannot be trained")
    return Problem(422, "bad-input", str(error), title="Input cannot be used")


class AllowedMethods:
    """Called with a path, gives the methods of all routes that match it, sorted; each router has its prefix.

    The routes with the fewest parameters are the ones its path means: ``models/train`` is no model's id.
    """

    def __init__(self, routers: Callable[[], Iterable[tuple[str, APIRouter]]]) -> None:
        self._routers = routers

    @cached_property
    def _routes(self) -> list[tuple[re.Pattern[str], frozenset[str]]]:
        return [
            (compile_path(prefix + route.path)[0], frozenset(route.methods or ()))
            for prefix, router in self._routers()
            for route in router.routes
            if isinstance(route, Route)
        ]

    def __call__(self, path: str) -> list[str]:
        found = [(pattern, methods) for pattern, methods in self._routes if pattern.match(path)]
        fewest = min((pattern.groups for pattern, _ in found), default=0)
        return sorted(frozenset().union(*(each for pattern, each in found if pattern.groups == fewest)))


# What would be right in place of a field that was refused: our words for pydantic's findings.


_WANTED = {
    "missing": "it is missing; give it",
    "extra_forbidden": "there is no such field; leave it out",
    "json_invalid": "the body is no JSON; send one JSON value, in UTF-8",
    "none_required": "give null",
    "string": "give text",
    "string_unicode": "give text without lone surrogates",
    "int": "give a whole number",
    "float": "give a number",
    "decimal": "give a number",
    "finite_number": "give a finite number",
    "bool": "give true or false",
    "list": "give a list",
    "tuple": "give a list",
    "set": "give a list",
    "dict": "give an object with named values",
    "mapping": "give an object with named values",
    "model": "give an object with named fields",
    "model_attributes": "give an object with named fields",
    "literal_error": "give {expected}",
    "enum": "give {expected}",
    "greater_than": "give a number above {gt:g}",
    "greater_than_equal": "give {ge:g} or more",
    "less_than": "give a number below {lt:g}",
    "less_than_equal": "give {le:g} or less",
    "string_too_short": "give at least {min_length} characters",
    "string_too_long": "give at most {max_length} characters",
    "too_short": "give at least {min_length} of them",
    "too_long": "give at most {max_length} of them",
}
"""By the type of a finding, without its ending ``_type``, ``_parsing`` and the like; filled in from its
context."""
_ENDINGS = ("_type", "_parsing_size", "_parsing", "_from_float")
_UNKNOWN = "it is not of the form that this route's description shows; give one that is"


def what_is_right(finding: Mapping[str, Any]) -> str:
    """A sentence that shows of the input names alone: it may be huge, secret, or not JSON."""
    context = finding.get("ctx") or {}
    given = text if isinstance(text := finding.get("input"), str) else ""
    is_name = given.isprintable() and 0 < len(given) <= LONGEST_SHOWN
    if isinstance(context.get("error"), BadInput):  # raised by a check of ours
        return str(context["error"])[:300]
    kind = finding["type"]
    if kind == "string_pattern_mismatch":
        pattern = context.get("pattern", "")
        meaning = MEANING.get(pattern, f"give text of the form {pattern}")
        return f"{given!r} is not allowed; {meaning}" if is_name else meaning
    if kind == "literal_error" and is_name:
        meant = did_you_mean(given, re.findall("'([^']*)'", context["expected"]))
        return f"{given!r} is not known; {meant}"
    for ending in ("", *_ENDINGS):
        wanted = _WANTED.get(kind.removesuffix(ending) if ending else kind)
        if wanted is not None:
            return wanted.format(**context)[:300]
    return _UNKNOWN
