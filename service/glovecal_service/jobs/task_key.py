"""The name of a task's result: everything that decides it, hashed."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

from glovecal_service.store.texts import json_text


def task_key(kind: str, facts: Mapping[str, Any]) -> str:
    """``facts``: JSON-able; ids of models and artifacts of takes stand for what is in them."""
    software = [version(name) for name in ("glovecal-models", "glovecal-service")]
    text = json_text({"kind": kind, "software": software, **facts}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()
