"""JSON as the store writes it: standard JSON only, or BadInput."""

from __future__ import annotations

import json
from typing import Any

from glovecal_models.errors import BadInput


def json_text(value: Any, *, sort_keys: bool = False) -> str:
    """Compact ASCII JSON. Raises BadInput for NaN, infinity and what JSON has no form for."""
    try:
        return json.dumps(value, allow_nan=False, sort_keys=sort_keys, separators=(",", ":"))
    except (ValueError, TypeError, RecursionError) as error:
        raise BadInput(
            "a value cannot be stored: it is not finite, nested too deeply or no JSON; give plain text, "
            "finite numbers, lists and objects"
        ) from error
