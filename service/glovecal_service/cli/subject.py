"""``glovecal subject``: the people who wear gloves."""

from __future__ import annotations

from typing import Annotated

import typer

from glovecal_service.cli.connection import connect
from glovecal_service.cli.options import AsJson, identifier
from glovecal_service.cli.printing import moment, out, print_facts, print_json, print_table

app = typer.Typer(help="The people who wear gloves.", no_args_is_help=True)

Name = Annotated[str, typer.Argument(help="Short name: a-z, 0-9, _ and -.", callback=identifier("subject"))]


@app.command("add")
def add(
    name: Name,
    title: Annotated[str, typer.Option(help="The name as people write it.")] = "",
) -> None:
    """Add a subject."""
    with connect() as service:
        service.post("/subjects", {"name": name, "title": title})
    out.print(f"Added subject {name}.")


@app.command("list")
def list_subjects(as_json: AsJson = False) -> None:
    """List all subjects."""
    with connect() as service:
        rows = service.get("/subjects")
    if as_json:
        print_json(rows)
        return
    rows = [{**row, "title": row["title"] or None, "created_at": moment(row["created_at"])} for row in rows]
    columns = {"name": "subject", "title": "name", "created_at": "added"}
    print_table(rows, columns, empty="No subjects yet. Add one: glovecal subject add NAME")


@app.command("show")
def show(name: Name, as_json: AsJson = False) -> None:
    """Show one subject: takes, models, which one predicts live."""
    with connect() as service:
        document = service.get(f"/subjects/{name}")
        if as_json:
            print_json(document)
            return
        takes = service.get("/takes", {"subject": name})
        models = service.get("/models", {"subject": name})
    print_facts(
        {
            "subject": name,
            "name": document["title"] or None,
            "hand (mm)": document["dimensions"],
            "added": moment(document["created_at"]),
            "takes": len(takes),
            "models": len(models),
            "active": [
                f"{row['id'][:12]} ({row['method']}, {row['layout']})" for row in models if row["active"]
            ],
        }
    )


@app.command("remove")
def remove(name: Name) -> None:
    """Remove a subject that owns no takes and no models."""
    with connect() as service:
        service.delete(f"/subjects/{name}")
    out.print(f"Removed subject {name}.")
