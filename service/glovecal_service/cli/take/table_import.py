"""``glovecal take import`` and ``take look``: tables into the store, each file whole or not at all."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from glovecal_client.errors import ServiceError
from glovecal_service.cli.glove.layouts import layout_named
from glovecal_service.cli.take.files import ImportWarnings, added_subject, frames_among
from glovecal_service.cli.take.rows import print_takes, stored_takes
from glovecal_service.cli.terminal.connection import connect, stored_models
from glovecal_service.cli.terminal.options import AsJson, Subject
from glovecal_service.cli.terminal.presenting import present
from glovecal_service.cli.terminal.printing import REFUSED, Refusal, err, out, print_json, sentence_of
from glovecal_service.plain import document_of, read
from glovecal_service.rest.take.answer import ImportedTakes, Take

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

SERVER_FAULT = 500
GUESS = "guess"


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
    columns: Annotated[
        str | None,
        typer.Option(
            metavar="guess|FILE",
            help="How other programs' tables are read: as `take look` shows, or a file of its --json.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Import take tables. X.reference.csv beside X.frames.csv is found by itself.

    A subject that is not there yet is added. Files that fail are listed and
    skipped; the exit code is 1 then.
    """
    from glovecal_models.takes.table import reference_beside

    if reference and len(files) > 1:
        raise typer.BadParameter("--reference goes with one frames file")
    frames = frames_among(files)
    options = {"name": name, "wearing": wearing, "equal_times": "spread" if spread_equal_times else None}
    options |= {"replace": "true" if replace else None}
    documents: list[Any] = []
    refused, warnings = 0, ImportWarnings()
    with connect() as service:
        chosen = layout_named(service, layout)
        for file in frames:
            try:
                beside = reference or reference_beside(file)
                answer = (
                    _imported(service, file, beside, subject, chosen, options)
                    if columns is None
                    else _read_as(service, file, columns, subject, chosen, options)
                )
                _tell(service, file, subject, read(ImportedTakes, answer), warnings)
                documents += answer["takes"]
            except ServiceError as error:
                if error.status >= SERVER_FAULT:
                    raise
                refused += 1
                err.print(f"{file}: not imported: {sentence_of(error)}", style="red")
        rows = read(list[Take], documents)
        following = None if as_json or refused else _next(service, subject, rows)
    warnings.print()
    if as_json:
        print_json(documents)
    elif rows or not refused:
        print_takes(rows, empty="Nothing was imported.")
    if following:
        out.print(f"Next: {following}")
    if refused:
        if columns is None and not as_json:
            err.print("Of another program? `glovecal take look FILE` shows how it can be read.")
        raise typer.Exit(REFUSED)


def _next(service: RestClient, subject: str, rows: list[Take]) -> str | None:
    """Train with takes that teach, or hold the active model against those it has not seen."""
    teaching = [row for row in rows if row.teaches]
    if not teaching:
        return None
    layout = teaching[0].layout
    models = stored_models(service, subject=subject, layout=layout)
    active = next((model for model in models if model.active), None)
    if active is not None:
        is_new = any(row.id not in active.trained_on for row in teaching)
        return f"glovecal compare {active.short}" if is_new else None
    every = stored_takes(service, subject=subject)
    others = any(row.teaches and row.layout != layout for row in every)
    return f"glovecal train --subject {subject}" + (f" --layout {layout}" if others else "")


def look(
    files: Annotated[list[Path], typer.Argument(exists=True, dir_okay=False, help="Tables of any program.")],
    as_json: AsJson = False,
) -> None:
    """Show what tables would become, and how their columns are read. Nothing is imported."""
    from glovecal_models.takes.answer import TablePreview

    refused, documents = 0, []
    with connect() as service:
        for file in files:
            try:
                document = service.post("/takes/preview", _uploaded(service, file))
            except ServiceError as error:
                if error.status >= SERVER_FAULT:
                    raise
                refused += 1
                err.print(f"{file}: {sentence_of(error)}", style="red")
                continue
            documents.append(document)
            if not as_json:
                found = read(TablePreview, document)
                present(found.presentation())
                guessed = "" if found.is_take_table else " --columns guess"
                if found.problem is None:
                    out.print(f"Next: glovecal take import {shlex.quote(str(file))} --subject NAME{guessed}")
    if as_json:
        print_json(documents)
    if refused:
        raise typer.Exit(REFUSED)


def _uploaded(service: RestClient, file: Path) -> dict[str, Any]:
    return {"upload": service.upload(file), "filename": file.name}


def _read_as(
    service: RestClient,
    file: Path,
    columns: str,
    subject: str,
    layout: str | None,
    options: dict[str, str | None],
) -> dict[str, Any]:
    """``columns``: "guess", or a file of ``take look --json`` in which they may have been corrected."""
    from glovecal_models.takes.answer import TablePreview

    body = _uploaded(service, file) | {"wearing": options.get("wearing")}
    if columns != GUESS:
        body |= {"mapping": _mapping_in(Path(columns))}
    seen = read(TablePreview, service.post("/takes/preview", body))
    asked = {
        "mapping": document_of(seen.mapping),
        "equal_times": options.get("equal_times") or seen.equal_times,
        "name": options.get("name"),
        "replace": options.get("replace") is not None,
    }
    return service.post(
        "/takes/import", body | asked | {"subject": subject, "layout": layout, "create_subject": True}
    )


def _mapping_in(file: Path) -> Any:
    """Raises Refusal that names the file."""
    try:
        document = json.loads(file.read_text(encoding="utf-8"))
        return (document[0] if isinstance(document, list) else document)["mapping"]
    except OSError as error:
        raise Refusal(
            f"{file}: there is no such file; --columns is `guess`, or a file of take look --json"
        ) from error
    except (ValueError, KeyError, IndexError, TypeError) as error:
        raise Refusal(f"{file}: not what `glovecal take look FILE --json` prints") from error


def _imported(
    service: RestClient,
    file: Path,
    reference: Path | None,
    subject: str,
    layout: str | None,
    options: dict[str, str | None],
) -> dict[str, Any]:
    given = {key: value for key, value in options.items() if value is not None}
    return service.upload_takes(
        file, reference=reference, subject=subject, layout=layout, create_subject=True, **given
    )


def _tell(
    service: RestClient, file: Path, subject: str, answer: ImportedTakes, warnings: ImportWarnings
) -> None:
    if answer.subject_created:
        err.print(added_subject(service, subject), style="yellow")
    if answer.replaced:
        err.print(
            f"{file}: replaced the reference and names of {', '.join(answer.replaced)}. Existing models "
            "are unchanged; retrain.",
            style="yellow",
        )
    elif not answer.imported:
        err.print(f"{file}: its takes were here already", style="yellow")
    warnings.add(file, answer.warnings)
