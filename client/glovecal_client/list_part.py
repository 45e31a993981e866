"""A part of a list, as the service answers it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

TOTAL = "X-Total-Count"
"""Header of a list: how many rows there are in all, where they were counted."""


@dataclass(frozen=True)
class ListPart:
    """Some rows of a list."""

    rows: list[Any]
    after: str | None
    """Where the next part begins; None: there is none."""
    total: int | None
    """Rows of all parts; None: they were not counted."""
