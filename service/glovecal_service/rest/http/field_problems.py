"""What would be right in place of a field that was refused: our words for pydantic's findings."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_service.rest.http.request_types import LONGEST_SHOWN, MEANING

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
