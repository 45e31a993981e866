"""``glovecal audit``: who changed what."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.listing import (
    AfterPlace,
    EveryRow,
    MostRows,
    Wanted,
    Words,
    filtered,
)
from glovecal_service.cli.terminal.options import AsJson
from glovecal_service.cli.terminal.printing import (
    Overwrite,
    Refusal,
    out,
    print_table,
    require_place,
    write_whole,
)
from glovecal_service.plain import read
from glovecal_service.rest.access.answer import AuditCheck, AuditRow

app = typer.Typer(help="The log of changes: who changed what, when, from where.", no_args_is_help=True)


@app.command("list")
def list_audit(
    text: Words = None,
    limit: MostRows = None,
    every: EveryRow = False,
    after: AfterPlace = None,
    as_json: AsJson = False,
) -> None:
    """List changes, newest first."""
    wanted, query = Wanted(limit, every, after, as_json), {"text": text}
    with connect() as service:
        rows = wanted.rows(service, AuditRow, "/audit", filtered("audit list", **query), query)
    shown = [{**vars(row), "what": _what(row.changes)} for row in rows]
    columns = {
        "id": "no.",
        "at": "when",
        "who": "who",
        "origin": "from",
        "action": "asked",
        "what": "changed",
    }
    print_table(shown, columns, empty="Nothing was changed yet.")


@app.command("verify")
def verify() -> None:
    """Look whether the log is what was written: exit code 1 if an entry was changed, taken out or moved."""
    with connect() as service:
        check = read(AuditCheck, service.get("/audit/check"))
    if check.problems:
        raise Refusal("the log of changes was changed: " + "; ".join(check.problems[:10]))
    out.print(f"{check.entries} entries, each as it was written.")


@app.command("export")
def export(
    file: Annotated[Path, typer.Argument(help="Where to write, one JSON object a line, oldest first.")],
    overwrite: Overwrite = False,
) -> None:
    """Write the whole log."""
    require_place(file, overwrite=overwrite)
    with connect() as service:
        entries = service.get("/audit")
    lines = [json.dumps(entry, sort_keys=True) for entry in reversed(entries)]
    write_whole({file: "".join(f"{line}\n" for line in lines).encode()})


def _what(changes: list[dict[str, Any]]) -> str:
    return ", ".join(dict.fromkeys(f"{one['table']} {one['key']}" for one in changes))
