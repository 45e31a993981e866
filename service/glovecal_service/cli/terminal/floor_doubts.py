"""Noise floors that are not reliable, and why: printed below a table that holds them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from glovecal_service.cli.terminal.printing import err


def print_floor_doubts(floors: Mapping[str, Mapping[str, Any] | None]) -> None:
    """``floors``: by rotation, as answers hold them. One line for each set of reasons."""
    by_reasons: dict[tuple[str, ...], list[str]] = {}
    for name, floor in floors.items():
        if floor is not None and floor.get("reasons"):
            by_reasons.setdefault(tuple(floor["reasons"]), []).append(name)
    for reasons, names in by_reasons.items():
        err.print(f"Noise floor not reliable ({', '.join(names)}): {'; '.join(reasons)}.")
