"""``glovecal glove``: layouts, stored or in a file, and the gloves that were seen."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from glovecal_client.errors import ServiceError
from glovecal_models.errors import BadInput
from glovecal_models.names import check_identifier
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, Glove, identifier, subject_named
from glovecal_service.cli.terminal.printing import (
    REFUSED,
    Overwrite,
    Refusal,
    exit_code_of,
    out,
    print_json,
    print_table,
    read_or_print,
    require_place,
    sentence_of,
    write_whole,
)
from glovecal_service.plain import read
from glovecal_service.rest.glove.answer import MOST_DELAY_MS, Gloves, LatencyView, LayoutView

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

app = typer.Typer(help="Layouts, and the gloves that were seen.", no_args_is_help=True)

Layout = Annotated[str, typer.Argument(help="Layout name.", callback=identifier("layout"))]


@app.command("list")
def list_gloves(as_json: AsJson = False) -> None:
    """List layouts and the gloves seen on the network."""
    with connect() as service:
        document = service.get("/gloves")
    found = read_or_print(Gloves, document, as_json)
    layouts = [
        {**vars(item), "sensors": len(item.sensors), "rotations": len(item.rotations)}
        for item in found.layouts
    ]
    print_table(
        layouts,
        {"name": "layout", "sensors": "sensors", "rotations": "rotations", "title": "description"},
        empty="No layouts.",
    )
    out.print()
    print_table(
        [
            {**vars(item), "latency": _latency(item.latency), "delay": item.delay_ms or ""}
            for item in found.seen
        ],
        {
            "name": "glove",
            "layout": "layout",
            "subject": "worn by",
            "wearing": "wearing",
            "simulated": "simulated",
            "latency": "latency (ms)",
            "delay": "delay (ms)",
            "last_seen_at": "last seen",
        },
        empty="No glove seen yet. Start one: glovecal capture --device cyberglove:PORT --glove NAME",
    )


def _latency(measured: LatencyView | None) -> str:
    if measured is None:
        return ""
    return f"{1000 * measured.latency_s:.0f} ± {1000 * measured.sd_s:.1f}"


@app.command("show")
def show(name: Layout, as_json: AsJson = False) -> None:
    """Print a layout as a layout file (JSON): change its name and go on from there.

    With --json everything the service knows of it.
    """
    with connect() as service:
        document = service.get(f"/gloves/{name}")
    print_json(document if as_json else read(LayoutView, document).document)


@app.command("add")
def add(
    file: Annotated[Path, typer.Argument(exists=True, dir_okay=False, help="A layout file, TOML or JSON.")],
) -> None:
    """Add a layout of your own from a file."""
    with connect() as service:
        name = add_layout_file(service, file)
        found = read(LayoutView, service.get(f"/gloves/{name}"))
    out.print(f"Added layout {name}: {len(found.sensors)} sensors, {len(found.rotations)} rotations.")


@app.command("people")
def people(
    name: Layout,
    file: Annotated[Path, typer.Argument(dir_okay=False, help="A .json file to write.")],
    overwrite: Overwrite = False,
) -> None:
    """Write what the people of a layout have in common, as a prior for somebody new elsewhere.

    Means and variances only: no reading, angle or name of a person. To use it: glovecal train --people-file.
    """
    require_place(file, overwrite=overwrite)
    with connect() as service:
        document = service.get(f"/gloves/{name}/people")
    write_whole({file: (json.dumps(document, indent=1) + "\n").encode()})


@app.command("wear")
def wear(
    glove: Glove,
    subject: Annotated[str | None, typer.Argument(help="Who wears it now.", callback=subject_named)] = None,
    wearing: Annotated[
        str | None, typer.Option(help="Name of this wearing; readings shift between wearings.")
    ] = None,
    nobody: Annotated[bool, typer.Option("--nobody", help="The glove was taken off.")] = False,
) -> None:
    """Set who wears a glove; the live service switches to that subject's model."""
    if (subject is None) != nobody:
        raise typer.BadParameter("give SUBJECT, or --nobody")
    with connect() as service:
        service.put(f"/gloves/{glove}/wearer", {"subject": subject, "wearing": wearing})
    out.print(f"{glove} is worn by {subject or 'nobody'}.")


@app.command("delay")
def delay(
    glove: Glove,
    milliseconds: Annotated[
        int, typer.Argument(metavar="MS", min=0, max=MOST_DELAY_MS, help="0: live, without a delay.")
    ],
) -> None:
    """Have a glove's live poses wait for the frames after them: less noise, and a lag led back further."""
    with connect() as service:
        service.put(f"/gloves/{glove}/delay", {"delay_ms": milliseconds})
    out.print(f"Poses of {glove} come {milliseconds} ms late." if milliseconds else f"{glove} is live.")


@app.command("remove")
def remove(glove: Glove) -> None:
    """Forget a glove that was seen; its takes and recordings stay. Refused while it streams."""
    with connect() as service:
        service.delete(f"/gloves/{glove}")
    out.print(f"Glove {glove} was removed. It is stored again once it sends frames.")


def add_layout_file(service: RestClient, file: Path) -> str:
    """Store the layout in a TOML or JSON file; its name. Raises Refusal that names the file."""
    from glovecal_client.rest import layout_name

    try:
        check_identifier(layout_name(file.read_bytes(), file), "name of the layout")
        return service.add_layout(file)
    except (BadInput, ServiceError) as error:
        if exit_code_of(error) != REFUSED:
            raise
        raise Refusal(f"{file}: {sentence_of(error)}") from error


def layout_named(service: RestClient, layout: str | None) -> str | None:
    """The layout's name; a file is stored under the name in it. Raises typer.BadParameter for neither."""
    if layout is None:
        return None
    if Path(layout).is_file():
        return add_layout_file(service, Path(layout))
    if Path(layout).suffix in (".toml", ".json") or "/" in layout:
        raise typer.BadParameter(f"there is no layout file {layout!r}")
    try:
        return check_identifier(layout, "layout")
    except BadInput as error:
        raise typer.BadParameter(str(error)) from error
