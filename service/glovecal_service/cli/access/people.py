"""``glovecal person``: who logs in with a name and a password, or at a provider of OpenID Connect."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated

import typer

from glovecal_client.site.roles import Role
from glovecal_service.cli.access.keys import SCOPE_COLUMNS, RoleOption, SubjectOption, scope_row, whose
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson
from glovecal_service.cli.terminal.printing import Refusal, out, print_json, print_table, read_or_print
from glovecal_service.plain import read
from glovecal_service.rest.access.answer import Person

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

app = typer.Typer(help="People who log in.", no_args_is_help=True)
Name = Annotated[str, typer.Argument(help="Of the person.")]


@app.command("add")
def add(
    name: Annotated[str, typer.Argument(help="What is typed at the login, such as anna.")],
    role: RoleOption = "viewer",
    subject: SubjectOption = None,
    as_json: AsJson = False,
) -> None:
    """Add a person. The password is asked for, or read as one line of standard input."""
    body = {"name": name, "role": role, "subjects": subject, "password": _typed_password(name)}
    with connect() as service:
        made = read(Person, service.post("/people", body))
    if as_json:
        print_json(made.model_dump(mode="json"))
        return
    out.print(
        f"{made.name} ({made.role}, {whose(made)}) logs in at /login of the service. "
        f"To undo: glovecal person remove {made.name}"
    )


@app.command("list")
def list_people(as_json: AsJson = False) -> None:
    """List people who log in, those that were removed too."""
    with connect() as service:
        rows = read_or_print(list[Person], service.get("/people"), as_json)
    columns = {
        "name": "person",
        **SCOPE_COLUMNS,
        "password_changed_at": "password set",
        "issuer": "logs in at",
        "revoked_at": "removed",
    }
    empty = "Nobody yet. Add somebody: glovecal person add NAME --role operator"
    print_table([scope_row(row) for row in rows], columns, empty=empty)


@app.command("change")
def change(
    name: Name,
    role: Annotated[Role | None, typer.Option(help="Default: as it is.")] = None,
    subject: Annotated[
        list[str] | None, typer.Option("--subject", "-s", help="Of whom alone; default: as it is.")
    ] = None,
    everybody: Annotated[bool, typer.Option("--everybody", help="Of everybody.")] = False,
) -> None:
    """Change what a person may do. Who is logged in logs in again."""
    if role is None and subject is None and not everybody:
        raise Refusal("nothing is to be changed; give --role, --subject or --everybody")
    if subject and everybody:
        raise Refusal("--subject and --everybody contradict each other; give one of them")
    with connect() as service:
        before = _person(service, name)
        subjects = None if everybody else subject or (before and before.subjects)
        body = {"role": role or (before.role if before else "viewer"), "subjects": subjects}
        after = read(Person, service.put(f"/people/{name}", body))
    out.print(f"{after.name} has the role {after.role} now, {whose(after)}.")


@app.command("password")
def password(name: Name) -> None:
    """Set a new password; it is asked for, or read from standard input. Who is logged in logs in again."""
    body = {"password": _typed_password(name)}
    with connect() as service:
        service.put(f"/people/{name}/password", body)
    out.print(f"The password of {name} is changed.")


@app.command("remove")
def remove(name: Name) -> None:
    """Nothing is open to a person from the next request on. The name is not used again."""
    with connect() as service:
        service.delete(f"/people/{name}")
    out.print(f"{name} logs in no more.")


def _person(service: RestClient, name: str) -> Person | None:
    """None where there is no such person, which the change itself refuses."""
    rows = read(list[Person], service.get("/people"))
    return next((row for row in rows if row.name == name.lower()), None)


def _typed_password(name: str) -> str:
    """Not shown, and never an argument: other users of the computer see those."""
    if sys.stdin.isatty():
        return typer.prompt(
            f"Password of {name}", hide_input=True, confirmation_prompt="The same again", err=True
        )
    return sys.stdin.readline().rstrip("\r\n")
