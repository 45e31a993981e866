"""Layout files as a user writes them, TOML or JSON."""

from __future__ import annotations

import json
import sys
from pathlib import Path


def layout_name(content: bytes, file: Path) -> str:
    """The ``name`` in a layout file, else the file's own name; the service judges whether it can be one."""
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        import tomli as tomllib

    try:
        document = json.loads(content) if is_json(file) else tomllib.loads(content.decode("utf-8"))
    except (ValueError, RecursionError):
        document = None
    name = document.get("name") if isinstance(document, dict) else None
    return name if isinstance(name, str) else file.stem.lower()


def is_json(file: Path) -> bool:
    return file.suffix.lower() == ".json"
