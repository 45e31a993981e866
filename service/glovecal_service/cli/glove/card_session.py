"""``glovecal card``: gloves that record on their own memory cards, left and right at once."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson
from glovecal_service.cli.terminal.printing import err, out, print_json, print_table
from glovecal_service.plain import read
from glovecal_service.rest.glove.answer import Card, GloveAnswers

COLUMNS = {
    "glove": "glove",
    "battery_v": "battery (V)",
    "ahead_ms": "clock ahead (ms)",
    "sd_ms": "std. dev. (ms)",
    "active_file": "file",
    "files": "files",
    "free_mb": "free (MB)",
}
REFUSED = 1


def card(
    gloves: Annotated[list[str], typer.Argument(help="Names of gloves, as captured.")],
    set_clock: Annotated[bool, typer.Option("--set-clock", help="Set the clocks to the computer's.")] = False,
    start: Annotated[
        str | None, typer.Option(metavar="FILE", help="Record on the cards, into FILE, such as MONDAY.DAT.")
    ] = None,
    stop: Annotated[bool, typer.Option("--stop", help="End the recording on the cards.")] = False,
    as_json: AsJson = False,
) -> None:
    """Battery, clock, active file and files of gloves with a memory card; start and stop recording there.

    All gloves are asked at once. "glovecal read-card" makes a take table of a recording.
    """
    asked = [name for name, wanted in (("set-clock", set_clock), ("start", start), ("stop", stop)) if wanted]
    if len(asked) > 1:
        raise typer.BadParameter("give one of --set-clock, --start and --stop")
    body = {"gloves": gloves, "do": asked[0] if asked else "status", "argument": start or ""}
    with connect() as service:
        document = service.post("/glove-commands", body)
    found = read(GloveAnswers, document)
    if as_json:
        print_json(document)
    else:
        rows = [row(item.glove, item.card) for item in found.answers if item.answer]
        print_table(rows, COLUMNS, empty="No glove answered.")
        for told in found.sentences:
            out.print(told)
    refused = [item for item in found.answers if item.problem]
    for item in refused:
        err.print(f"{item.glove}: {item.problem}", style="red")
    if refused:
        raise typer.Exit(REFUSED)


def row(glove: str, card: Card) -> dict[str, Any]:
    """An answer as a row of the table."""
    clock = card.clock
    return {
        **vars(card),
        "glove": glove,
        "files": ", ".join(card.files or ()),
        "ahead_ms": round(1e3 * clock.ahead_s, 1) if clock else None,
        "sd_ms": round(1e3 * clock.sd_s, 1) if clock else None,
    }
