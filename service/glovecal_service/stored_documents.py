"""Documents of jobs under today's names, for pages that are made of any document."""

from __future__ import annotations

from typing import Any

from glovecal_service.views.renamed_keys import RENAMED


def current(document: Any) -> Any:
    """A copy with today's keys at every depth. A document that has both keeps today's value."""
    if isinstance(document, dict):
        named = {RENAMED.get(key, key): current(value) for key, value in document.items()}
        return named | {key: current(value) for key, value in document.items() if key in named}
    if isinstance(document, list | tuple):
        return [current(item) for item in document]
    return document
