"""Answers as JSON and back: no NaN, no lone surrogates, nothing of numpy, no library's words."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from contextlib import suppress
from datetime import datetime
from pathlib import PurePath
from threading import Lock
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, TypeAdapter

from glovecal_client.errors import ClientError
from glovecal_models.errors import reason_of as reason_of_models

LONGEST_TEXT = 2000
MOST_TRIES = 100
Found = TypeVar("Found")
_adapters: dict[Any, TypeAdapter[Any]] = {}
_making_one = Lock()


class Row(BaseModel):
    """What REST lists, read by attribute wherever it is shown."""

    model_config = ConfigDict(frozen=True)


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


def document_of(answer: Any) -> dict[str, Any]:
    """The answer as JSON-able data; NaN and infinity are null."""
    return plain(_adapter(type(answer)).dump_python(answer))


def json_of(answer: Any) -> bytes:
    """The answer as the bytes of a message; NaN and infinity are null."""
    return _adapter(type(answer)).dump_json(answer)


def read(kind: type[Found], document: Any) -> Found:
    """An answer as its type has it. Raises pydantic.ValidationError."""
    return _adapter(kind).validate_python(document)


def _adapter(kind: Any) -> TypeAdapter[Any]:
    """Made once: it parses the source of ``kind`` for its fields' docstrings, which costs more than any
    answer. CPython 3.11 counts how deep it is in a syntax tree for all threads together, and raises
    SystemError where another one parses too: then it is made again, ``MOST_TRIES`` times at most."""
    with _making_one:
        for _ in range(MOST_TRIES):
            if kind in _adapters:
                break
            with suppress(SystemError):
                _adapters[kind] = TypeAdapter(kind)
        return _adapters[kind] if kind in _adapters else TypeAdapter(kind)


def video_name(filename: str) -> str:
    """The name that a video is kept under where nobody names it: its own, as names are written."""
    return re.sub(r"[^a-z0-9_-]+", "-", PurePath(filename).stem.lower()).strip("-_")[:64] or "video"
