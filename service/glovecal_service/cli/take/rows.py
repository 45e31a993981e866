"""Takes as a table for people."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from glovecal_service.cli.terminal.printing import print_table

COLUMNS = {
    "id": "take",
    "name": "name",
    "subject": "subject",
    "layout": "layout",
    "wearing": "wearing",
    "duration_s": "seconds",
    "measured": "angles",
    "state": "state",
    "simulated": "sim",
}


def print_takes(rows: Sequence[dict[str, Any]], *, empty: str) -> None:
    """``angles`` is how many rotations have a reference, ``sim`` whether the glove was a simulated one."""
    shown = [{**row, "measured": len(row["rotations"]) or None} for row in rows]
    print_table(shown, COLUMNS, empty=empty, folds="name")
