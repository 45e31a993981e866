"""``glovecal glove``: layouts, and the gloves that were seen."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from glovecal_service.cli.connection import connect
from glovecal_service.cli.options import AsJson
from glovecal_service.cli.printing import out, print_json, print_table

app = typer.Typer(help="Layouts, and the gloves that were seen.", no_args_is_help=True)


@app.command("list")
def list_gloves(as_json: AsJson = False) -> None:
    """List layouts and the gloves seen on the network."""
    with connect() as service:
        document = service.get("/gloves")
    if as_json:
        print_json(document)
        return
    layouts = [
        {**item, "sensors": len(item["sensors"]), "rotations": len(item["rotations"])}
        for item in document["layouts"]
    ]
    print_table(
        layouts,
        {"name": "layout", "sensors": "sensors", "rotations": "rotations", "title": "what it is"},
        empty="No layouts.",
    )
    out.print()
    print_table(
        document["seen"],
        {
            "name": "glove",
            "layout": "layout",
            "subject": "worn by",
            "wearing": "wearing",
            "simulated": "simulated",
        },
        empty="No glove was seen yet. Start one: glovecal capture --device cyberglove:PORT --glove NAME",
    )


@app.command("show")
def show(name: str) -> None:
    """Print a layout as JSON, a starting point for one's own."""
    with connect() as service:
        print_json(service.get(f"/gloves/{name}"))


@app.command("add")
def add(
    file: Annotated[Path, typer.Argument(exists=True, dir_okay=False, help="A layout file (TOML).")],
) -> None:
    """Add a layout of your own from a TOML file."""
    with connect() as service:
        name = service.add_layout(file)
    out.print(f"Added layout {name}.")


@app.command("wear")
def wear(
    glove: Annotated[str, typer.Argument(help="The glove's name.")],
    subject: Annotated[str, typer.Argument(help="Who wears it now.")],
    wearing: Annotated[
        str | None, typer.Option(help="Name of this donning; new readings shift between them.")
    ] = None,
) -> None:
    """Say who wears a glove now; the live service changes to that subject's model."""
    with connect() as service:
        service.put(f"/gloves/{glove}/wearer", {"subject": subject, "wearing": wearing})
    out.print(f"{glove} is worn by {subject}.")
