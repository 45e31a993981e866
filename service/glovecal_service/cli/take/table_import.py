"""``glovecal take import``: take tables into the store, each file whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from glovecal_client.errors import ServiceError
from glovecal_service.cli.glove.layouts import layout_named
from glovecal_service.cli.take.files import ImportWarnings, added_subject, frames_among
from glovecal_service.cli.take.rows import print_takes
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, Subject
from glovecal_service.cli.terminal.printing import err, out, print_json
from glovecal_service.cli.terminal.refusal import REFUSED, sentence_of

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

SERVER_FAULT = 500


def import_takes(
    files: Annotated[
        list[Path], typer.Argument(exists=True, dir_okay=False, help="CSV or Parquet take tables.")
    ],
    subject: Subject,
    layout: Annotated[
        str | None,
        typer.Option("--layout", "-l", help="Layout name or layout file. Default: made of the columns."),
    ] = None,
    reference: Annotated[
        Path | None,
        typer.Option(exists=True, dir_okay=False, help="Reference table of a single frames file."),
    ] = None,
    name: Annotated[
        str | None, typer.Option(help="Name of the take. Default: in the file, else the file's.")
    ] = None,
    wearing: Annotated[str | None, typer.Option(help="The wearing, where the file does not say it.")] = None,
    spread_equal_times: Annotated[
        bool,
        typer.Option("--spread-equal-times", help="Frames stamped in batches: spread each over its batch."),
    ] = False,
    replace: Annotated[
        bool,
        typer.Option("--replace", help="Takes that are here get the file's reference and names; ids stay."),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Import take tables. X.reference.csv beside X.frames.csv is found by itself.

    A subject that is not there yet is added. A file that cannot be imported is told and the others are
    imported; the exit code is 1 then.
    """
    from glovecal_models.takes.table import reference_beside

    if reference and len(files) > 1:
        raise typer.BadParameter("--reference goes with one frames file")
    frames = frames_among(files)
    options = {"name": name, "wearing": wearing, "equal_times": "spread" if spread_equal_times else None}
    options["replace"] = "true" if replace else None
    rows, refused, warnings = [], 0, ImportWarnings()
    with connect() as service:
        chosen = layout_named(service, layout)
        for file in frames:
            try:
                beside = reference or reference_beside(file)
                rows += _import(service, file, beside, subject, chosen, options, warnings)
            except ServiceError as error:
                if error.status >= SERVER_FAULT:
                    raise
                refused += 1
                err.print(f"{file}: not imported: {sentence_of(error)}", style="red")
        following = None if as_json or refused else _next(service, subject, rows)
    warnings.print()
    if as_json:
        print_json(rows)
    elif rows or not refused:
        print_takes(rows, empty="Nothing was imported.")
    if following:
        out.print(f"Next: {following}")
    if refused:
        raise typer.Exit(REFUSED)


def _next(service: RestClient, subject: str, rows: list[dict[str, Any]]) -> str | None:
    """Train with takes that teach, or hold the active model against those it has not seen."""
    teaching = [row for row in rows if row["teaches"]]
    if not teaching:
        return None
    layout = teaching[0]["layout"]
    models = service.get("/models", {"subject": subject, "layout": layout})
    active = next((model for model in models if model["active"]), None)
    if active is not None:
        seen = {take["id"] for take in active["facts"].get("takes", [])}
        is_new = any(row["id"] not in seen for row in teaching)
        return f"glovecal compare {active['id'][:12]}" if is_new else None
    every = service.get("/takes", {"subject": subject})
    others = any(row["teaches"] and row["layout"] != layout for row in every)
    return f"glovecal train --subject {subject}" + (f" --layout {layout}" if others else "")


def _import(
    service: RestClient,
    file: Path,
    reference: Path | None,
    subject: str,
    layout: str | None,
    options: dict[str, str | None],
    warnings: ImportWarnings,
) -> list[dict[str, Any]]:
    given = {key: value for key, value in options.items() if value is not None}
    answer = service.upload_takes(
        file, reference=reference, subject=subject, layout=layout, create_subject=True, **given
    )
    if answer["subject_created"]:
        err.print(added_subject(service, subject), style="yellow")
    if answer["replaced"]:
        err.print(
            f"{file}: replaced the reference and names of {', '.join(answer['replaced'])}. Existing models "
            "are unchanged; retrain.",
            style="yellow",
        )
    elif not answer["imported"]:
        err.print(f"{file}: its takes were here already", style="yellow")
    warnings.add(file, answer["warnings"])
    return answer["takes"]
