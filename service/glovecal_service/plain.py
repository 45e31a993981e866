"""Values made safe for an answer: no NaN, no lone surrogates, nothing of numpy, no library's words."""

from __future__ import annotations

import math
from collections.abc import Mapping
from datetime import datetime
from pathlib import PurePath
from typing import Any

import numpy as np

from glovecal_client.errors import ClientError
from glovecal_models.errors import reason_of as reason_of_models

LONGEST_TEXT = 2000


def plain_text(text: str, longest: int = LONGEST_TEXT) -> str:
    """``text`` as UTF-8 can carry it (lone surrogates escaped), at most ``longest`` characters."""
    text = text.encode("utf-8", "backslashreplace").decode("utf-8")
    return text if len(text) <= longest else text[: longest - 1] + "…"


def plain(value: Any) -> Any:
    """``value`` as JSON-able data; NaN and infinity become None (JSON has no word for them)."""
    if isinstance(value, str):
        return plain_text(value, 100_000)
    if isinstance(value, bool | int) or value is None:
        return value
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {plain_text(str(key)): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, datetime):
        return value.isoformat()
    if isinstance(value, PurePath):
        return value.name
    return plain_text(str(value))


def reason_of(error: BaseException) -> str:
    """What a person can be told of an error, whichever part of Glovecal or of its libraries raised it."""
    return str(error) if isinstance(error, ClientError) else reason_of_models(error)
