"""``glovecal key``: with which programs and people prove who they are."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from glovecal_client.site.roles import Role
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson
from glovecal_service.cli.terminal.printing import out, print_json, print_table, read_or_print
from glovecal_service.plain import read
from glovecal_service.rest.access.answer import Key, NewKey

app = typer.Typer(
    help="Keys: who may do what, where the service is reached from elsewhere.", no_args_is_help=True
)


RoleOption = Annotated[Role, typer.Option(help="Looks; records too; trains and activates too; everything.")]
SubjectOption = Annotated[
    list[str] | None, typer.Option("--subject", "-s", help="Of whom alone; default: of everybody.")
]
SCOPE_COLUMNS = {"role": "role", "subjects": "of", "created_at": "made"}


def scope_row(row: Key) -> dict[str, Any]:
    """As a table has it."""
    return {**vars(row), "subjects": row.sees}


def whose(row: Key) -> str:
    """For a sentence: of whom it sees takes and models."""
    return "everybody's takes and models" if row.subjects is None else f"of {row.sees} alone"


@app.command("add")
def add(
    name: Annotated[str, typer.Argument(help="Who or what has it, such as anna or capture-3.")],
    role: RoleOption = "viewer",
    subject: SubjectOption = None,
    as_json: AsJson = False,
) -> None:
    """Make a key and print it, once. Give it as GLOVECAL_KEY, or type it where the studio asks."""
    with connect() as service:
        made = read(NewKey, service.post("/keys", {"name": name, "role": role, "subjects": subject}))
    if as_json:
        print_json(made.model_dump(mode="json"))
        return
    out.print(made.key, soft_wrap=True)
    out.print(
        f"The key of {made.name} ({made.role}, {whose(made)}); it is not shown again. "
        f"To undo: glovecal key revoke {name}"
    )


@app.command("list")
def list_keys(as_json: AsJson = False) -> None:
    """List keys, those that were revoked too."""
    with connect() as service:
        rows = read_or_print(list[Key], service.get("/keys"), as_json)
    columns = {"name": "key", **SCOPE_COLUMNS, "revoked_at": "revoked"}
    print_table(
        [scope_row(row) for row in rows],
        columns,
        empty="No keys yet. Make one: glovecal key add NAME --role admin",
    )


@app.command("revoke")
def revoke(name: Annotated[str, typer.Argument(help="Of the key.")]) -> None:
    """A key opens nothing from the next request on."""
    with connect() as service:
        service.delete(f"/keys/{name}")
    out.print(f"Key {name} is revoked.")
