"""What people and programs give as text: free text on one line, JSON of the standard; else BadInput."""

from __future__ import annotations

import json
import unicodedata
from typing import Any

from glovecal_models.errors import BadInput

LONGEST = 200


def check_text(text: str, what: str, *, empty: bool = False) -> str:
    """Return ``text`` or raise BadInput: at most 200 characters, no control characters or lone surrogates."""
    if not isinstance(text, str):
        raise BadInput(f"{what} must be text, not {type(text).__name__}")
    if not text and not empty:
        raise BadInput(f"{what} is empty; give it a name")
    if len(text) > LONGEST:
        raise BadInput(f"{what} has {len(text)} characters; at most {LONGEST} are kept")
    for character in text:
        if unicodedata.category(character) in ("Cc", "Cs", "Zl", "Zp"):
            raise BadInput(f"{what} holds the character U+{ord(character):04X}, which is not text")
    return text


def json_text(value: Any, *, sort_keys: bool = False) -> str:
    """Compact ASCII JSON. Raises BadInput for NaN, infinity and what JSON has no form for."""
    try:
        return json.dumps(value, allow_nan=False, sort_keys=sort_keys, separators=(",", ":"))
    except (ValueError, TypeError, RecursionError) as error:
        raise BadInput(
            "a value cannot be stored: it is not finite, nested too deeply or no JSON; give plain text, "
            "finite numbers, lists and objects"
        ) from error
