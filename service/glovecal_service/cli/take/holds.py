"""``glovecal take holds``: what readings do while a pose is held; needs no model and no angles."""

from __future__ import annotations

from typing import Annotated

import typer

from glovecal_service.cli.take.rows import find_takes, only_layout, stored_takes
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, OnlyLayout, OnlySubject
from glovecal_service.cli.terminal.presenting import present
from glovecal_service.cli.terminal.printing import Refusal, read_or_print
from glovecal_service.questions.holds import QUESTION


def holds(
    take: Annotated[
        list[str] | None, typer.Argument(help="Takes: names or ids. Default: all of the subject.")
    ] = None,
    subject: OnlySubject = None,
    layout: OnlyLayout = None,
    as_json: AsJson = False,
) -> None:
    """Show how readings drift while a pose is held: creep, a hand that relaxes, or warm-up."""
    with connect() as service:
        rows = stored_takes(service, subject=subject, layout=layout)
        rows = find_takes(rows, take) if take else rows
        if not rows:
            raise Refusal("there is no take to look at; import some with glovecal take import")
        only_layout(rows)
        found = service.post("/takes/holds", {"takes": [row.id for row in rows]})
    present(read_or_print(QUESTION.answer, found, as_json).presentation())
