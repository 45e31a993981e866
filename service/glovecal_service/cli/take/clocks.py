"""``glovecal take clocks``: do the clocks of glove and reference agree, and repair them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from glovecal_models.takes.answer import TakeClock
from glovecal_service.cli.take.rows import find_takes, stored_takes
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, OnlySubject
from glovecal_service.cli.terminal.printing import Refusal, err, out, print_json
from glovecal_service.plain import read
from glovecal_service.rest.take.answer import Take

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient


def clocks(
    take: Annotated[
        list[str] | None, typer.Argument(help="Takes: names or ids. Default: all with a reference.")
    ] = None,
    subject: OnlySubject = None,
    repair: Annotated[bool, typer.Option("--repair", help="Move the references that are off.")] = False,
    undo: Annotated[bool, typer.Option("--undo", help="Move repaired references back.")] = False,
    as_json: AsJson = False,
) -> None:
    """Examine whether each reference runs on the glove's clock; takes of a wearing are judged together."""
    if repair and undo:
        raise typer.BadParameter("either --repair or --undo, not both")
    with connect() as service:
        rows = _chosen(service, subject, take or [])
        body: dict[str, Any] = {"takes": [row.id for row in rows]}
        if undo:
            answer = service.post("/takes/clocks/undo", body)
        else:
            answer = service.post("/takes/clocks", {**body, "repair": repair})
    if as_json:
        print_json(answer)
    elif undo:
        out.print(f"Moved {len(answer)} of {len(rows)} references back.")
    else:
        _print(read(list[TakeClock], answer), repair)


def _chosen(service: RestClient, subject: str | None, wanted: list[str]) -> list[Take]:
    rows = stored_takes(service, subject=subject)
    rows = find_takes(rows, wanted) if wanted else [row for row in rows if row.reference_rows]
    if not rows:
        raise Refusal("there is no take with reference angles whose clock could be examined")
    return rows


def _print(answer: list[TakeClock], repair: bool) -> None:
    for item in answer:
        out.print(item.sentence)
    off = sum(item.verdict == "offset" for item in answer)
    if repair:
        out.print(f"Repaired {off} of {len(answer)} references; --undo moves them back.")
        unknown = [item.take for item in answer if not item.is_found]
        if off and unknown:
            err.print(
                f"Not repaired, the clock was not found: {', '.join(unknown)}. Leave them out of training, or"
                " measure again.",
                style="yellow",
            )
        err.print("Existing models are unchanged; retrain to use the repair.")
    elif off:
        out.print(f"{off} of {len(answer)} references are off; --repair moves them.")
