"""Takes as rows of ``GET /takes``: which one somebody means, and a table of them for people."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from glovecal_models.hand.rotations import Handedness, is_of_hand
from glovecal_models.names import did_you_mean
from glovecal_service.cli.terminal.printing import Refusal, print_table
from glovecal_service.plain import read
from glovecal_service.rest.take.answer import Take

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

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
MOST_ALIKE, LONGEST_TEXT = 1000, 200
SHORTEST_BEGINNING = 4


def stored_takes(service: RestClient, **query: str | None) -> list[Take]:
    """``query``: subject, layout and hand, each or None."""
    return read(list[Take], service.get("/takes", query))


def named_take(service: RestClient, wanted: str) -> Take:
    """The stored take that is meant. Raises Refusal that lists what could be meant."""
    newest = {"reverse": True, "limit": MOST_ALIKE}
    alike = read(list[Take], service.get("/takes", newest | {"text": wanted[:LONGEST_TEXT]}))
    rows = alike if _meant(alike, wanted) else read(list[Take], service.get("/takes", newest))
    return find_take(rows[::-1], wanted)


def named_takes(service: RestClient, wanted: Iterable[str]) -> list[Take]:
    """Each stored take that is meant, once."""
    takes = [named_take(service, name) for name in wanted]
    return list({take.id: take for take in takes}.values())


def print_takes(rows: Sequence[Take], *, empty: str) -> None:
    """``angles`` is how many rotations have a reference, ``sim`` whether the glove was a simulated one."""
    shown = [{**vars(row), "measured": len(row.rotations) or None} for row in rows]
    print_table(shown, COLUMNS, empty=empty, folds="name")


def find_take(rows: Sequence[Take], wanted: str) -> Take:
    """The one that is meant. Raises Refusal that lists what could be meant."""
    found = _meant(rows, wanted)
    if len(found) == 1:
        return found[0]
    if found:
        raise Refusal(f"{len(found)} takes are called {wanted!r}: {_listed(found)}; give the id of one")
    meant = did_you_mean(wanted, (row.name for row in rows))
    raise Refusal(f"there is no take {wanted!r}; {meant}. List them: glovecal take list")


def _meant(rows: Sequence[Take], wanted: str) -> list[Take]:
    """By its id, its name or the beginning of its id."""
    named = [row for row in rows if row.id == wanted] or [row for row in rows if row.name == wanted]
    if named or len(wanted) < SHORTEST_BEGINNING:
        return named
    return [row for row in rows if row.id.startswith(wanted)]


def find_takes(rows: Sequence[Take], wanted: Iterable[str]) -> list[Take]:
    """Each take that is meant, once."""
    found = [find_take(rows, name) for name in wanted]
    return list({row.id: row for row in found}.values())


def takes_of(rows: Iterable[Take], hand: Handedness | None) -> list[Take]:
    """Takes of that hand, and those of which nobody said it; all without ``hand``."""
    return [row for row in rows if is_of_hand(row.known_hand, hand)]


def only_layout(takes: Iterable[Take]) -> str | None:
    """That of all takes; None without any. Raises Refusal for several."""
    layouts = sorted({take.layout for take in takes})
    if len(layouts) > 1:
        raise Refusal(f"the takes have layouts {', '.join(layouts)}; choose one with --layout")
    return next(iter(layouts), None)


def _listed(rows: Sequence[Take]) -> str:
    shown = ", ".join(f"{row.name} ({row.id} of {row.subject})" for row in rows[:MOST_SHOWN])
    more = len(rows) - MOST_SHOWN
    return f"{shown} and {more} more" if more > 0 else shown
