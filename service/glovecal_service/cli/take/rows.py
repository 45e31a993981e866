"""Takes as rows of ``GET /takes``: which one somebody means, and a table of them for people."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from glovecal_models.hand.handedness import Handedness, is_of_hand
from glovecal_models.names import did_you_mean
from glovecal_service.cli.terminal.printing import print_table
from glovecal_service.cli.terminal.refusal import Refusal

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
MOST_SHOWN = 8
SHORTEST_BEGINNING = 4


def print_takes(rows: Sequence[dict[str, Any]], *, empty: str) -> None:
    """``angles`` is how many rotations have a reference, ``sim`` whether the glove was a simulated one."""
    shown = [{**row, "measured": len(row["rotations"]) or None} for row in rows]
    print_table(shown, COLUMNS, empty=empty, folds="name")


def find_take(rows: Sequence[dict[str, Any]], wanted: str) -> dict[str, Any]:
    """The one row of ``GET /takes`` that is meant. Raises Refusal that lists what could be meant."""
    for row in rows:
        if row["id"] == wanted:
            return row
    found = [row for row in rows if row["name"] == wanted]
    if not found and len(wanted) >= SHORTEST_BEGINNING:
        found = [row for row in rows if row["id"].startswith(wanted)]
    if len(found) == 1:
        return found[0]
    if found:
        raise Refusal(f"{len(found)} takes are called {wanted!r}: {_listed(found)}; give the id of one")
    meant = did_you_mean(wanted, (row["name"] for row in rows))
    raise Refusal(f"there is no take {wanted!r}; {meant}. List them: glovecal take list")


def find_takes(rows: Sequence[dict[str, Any]], wanted: Iterable[str]) -> list[dict[str, Any]]:
    """Each take that is meant, once."""
    found = [find_take(rows, name) for name in wanted]
    return list({row["id"]: row for row in found}.values())


def takes_of(rows: Iterable[dict[str, Any]], hand: Handedness | None) -> list[dict[str, Any]]:
    """Takes of that hand, and those of which nobody said it; all without ``hand``."""
    return [row for row in rows if is_of_hand(row["known_hand"], hand)]


def _listed(rows: Sequence[dict[str, Any]]) -> str:
    shown = ", ".join(f"{row['name']} ({row['id']} of {row['subject']})" for row in rows[:MOST_SHOWN])
    more = len(rows) - MOST_SHOWN
    return f"{shown} and {more} more" if more > 0 else shown
