"""What somebody wrote as JSON, TOML or an archive: read whole, or refused with one sentence.

A parser's own words stay inside: they name neither the file nor what would be right.
"""

from __future__ import annotations

import json
import math
import re
import struct
import tomllib
import zipfile
import zlib
from typing import Any

from glovecal_models.errors import BadInput

LONGEST_INTEGER = 18
"""Digits: what 64 bits hold."""
UNREADABLE_ARCHIVE = (
    zipfile.BadZipFile, zlib.error, struct.error, ValueError, EOFError, OSError, KeyError, RuntimeError,
    MemoryError, OverflowError, SyntaxError,
)  # fmt: skip
"""What reading a zip file or NumPy archive raises: damaged, encrypted, packed by an unknown method."""


def read_json(content: str | bytes, name: str) -> Any:
    """The value; its numbers are finite and fit 64 bits. Raises BadInput; ``name`` begins the sentence."""
    try:
        return json.loads(
            _text(content, f"{name} is no JSON: it"),
            parse_float=_finite,
            parse_int=_integer,
            parse_constant=_not_finite,
        )
    except json.JSONDecodeError as error:
        raise BadInput(
            f"{name} is no JSON: it cannot be read from line {error.lineno}, column {error.colno} on; "
            "correct it there"
        ) from None
    except _BadNumber as error:
        raise BadInput(f"{name} holds the number {error.shown}; give finite numbers of 64 bits") from None
    except RecursionError:
        raise BadInput(f"{name} is no JSON: it is nested too deeply; give a few levels") from None


def read_toml(content: str | bytes, name: str) -> dict[str, Any]:
    """The table. Raises BadInput; ``name`` begins the sentence."""
    try:
        return tomllib.loads(_text(content, f"{name}: not valid TOML: it"))
    except tomllib.TOMLDecodeError as error:
        found = re.search(r"at line (\d+), column (\d+)", str(error))
        place = f"line {found[1]}, column {found[2]}" if found else "its last line"
        raise BadInput(
            f"{name}: not valid TOML: it cannot be read from {place} on; correct it there"
        ) from None
    except ValueError:  # an integer of thousands of digits
        raise BadInput(f"{name} holds an integer that is too long; give finite numbers of 64 bits") from None
    except RecursionError:
        raise BadInput(f"{name}: not valid TOML: it is nested too deeply; give a few levels") from None


def _text(content: str | bytes, what: str) -> str:
    if isinstance(content, str):
        return content
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        raise BadInput(f"{what} is not UTF-8 text from byte {error.start} on; save it as UTF-8") from None


class _BadNumber(Exception):
    def __init__(self, text: str) -> None:
        self.shown = text if len(text) <= 40 else f"{text[:20]}... ({len(text)} digits)"


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise _BadNumber(text)
    return value


def _integer(text: str) -> int:
    if len(text.lstrip("-")) > LONGEST_INTEGER:
        raise _BadNumber(text)
    return int(text)


def _not_finite(word: str) -> float:
    raise _BadNumber(word)
