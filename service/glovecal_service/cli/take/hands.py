"""``glovecal take hands``: how far the clocks of two hands' takes are apart."""

from __future__ import annotations

from typing import Annotated

import typer

from glovecal_service.cli.take.rows import named_take
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson
from glovecal_service.cli.terminal.printing import out, read_or_print
from glovecal_service.rest.take.answer import HandAlignmentView


def hands(
    first: Annotated[str, typer.Argument(help="A take of one hand: name or id.")],
    second: Annotated[str, typer.Argument(help="A take of the other hand, recorded at the same time.")],
    claps: Annotated[bool, typer.Option("--claps", help="Go by claps that both gloves felt.")] = False,
    as_json: AsJson = False,
) -> None:
    """Tell how far the clocks of two hands' takes are apart, with its standard deviation.

    "glovecal take motion" joins two takes by the same.
    """
    with connect() as service:
        wanted = [named_take(service, name).id for name in (first, second)]
        found = service.post("/takes/hands", {"takes": wanted, "claps": claps})
    out.print(read_or_print(HandAlignmentView, found, as_json).sentence)
