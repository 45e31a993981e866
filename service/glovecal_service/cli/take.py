"""``glovecal take``: recordings, from files or from the live glove."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from glovecal_client.errors import ServiceError
from glovecal_service.cli.connection import connect
from glovecal_service.cli.options import AsJson, LayoutName, Subject
from glovecal_service.cli.printing import err, out, print_facts, print_json, print_table

app = typer.Typer(help="Takes: recordings with or without reference angles.", no_args_is_help=True)

CONFLICT = 409
"""The service's answer when a take is two tables."""

COLUMNS = {
    "id": "take",
    "name": "name",
    "subject": "subject",
    "layout": "layout",
    "wearing": "wearing",
    "frames": "frames",
    "duration_s": "seconds",
    "measured": "rotations measured",
    "simulated": "simulated",
}


@app.command("import")
def import_takes(
    files: Annotated[
        list[Path], typer.Argument(exists=True, dir_okay=False, help="CSV or Parquet take tables.")
    ],
    subject: Subject,
    layout: LayoutName = None,
    reference: Annotated[
        Path | None,
        typer.Option(exists=True, dir_okay=False, help="Reference table of a single frames file."),
    ] = None,
    spread_equal_times: Annotated[
        bool, typer.Option(help="Frames stamped in batches: spread each batch up to the next time.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Import take tables. X.reference.csv beside X.frames.csv is found by itself."""
    if reference and len(files) > 1:
        raise typer.BadParameter("--reference goes with one frames file")
    frames = [file for file in files if not _is_reference_of_another(file, files)]
    rows = []
    with connect() as service:
        name = service.add_layout(Path(layout)) if layout and Path(layout).is_file() else layout
        for file in frames:
            answer = service.upload_takes(
                file,
                reference=reference or _beside(file),
                subject=subject,
                layout=name,
                equal_times="spread" if spread_equal_times else "refuse",
            )
            rows.extend(answer["takes"])
            for sentence in answer.get("warnings", []):
                err.print(f"{file.name}: {sentence}", style="yellow", markup=False)
    if as_json:
        print_json(rows)
        return
    print_table(_readable(rows), COLUMNS, empty="Nothing was imported.")


@app.command("list")
def list_takes(
    subject: Annotated[str | None, typer.Option("--subject", "-s")] = None, as_json: AsJson = False
) -> None:
    """List takes."""
    with connect() as service:
        rows = service.get("/takes", {"subject": subject} if subject else None)
    if as_json:
        print_json(rows)
        return
    print_table(
        _readable(rows), COLUMNS, empty="No takes yet. Import some: glovecal take import FILE --subject NAME"
    )


@app.command("examine")
def examine(take: str, as_json: AsJson = False) -> None:
    """Show one take: how long, how regular, what was measured, what looks wrong."""
    with connect() as service:
        document = service.get(f"/takes/{take}")
    print_json(document) if as_json else print_facts(document)


@app.command("reference")
def reference(
    take: str,
    file: Annotated[
        Path, typer.Argument(exists=True, dir_okay=False, help="Table with time_s and r.* columns.")
    ],
    clock: Annotated[str, typer.Option(help="take: same time_s as the take; wall: Unix seconds.")] = "take",
) -> None:
    """Attach reference angles that were measured elsewhere to a recorded take."""
    with connect() as service:
        document = service.attach_reference(take, file, clock=clock)
    out.print(f"Take {document['name']} now has {document['reference_rows']} reference rows.")


@app.command("export")
def export(
    take: str,
    file: Annotated[Path, typer.Argument(help="Where to write; .csv or .parquet.")],
) -> None:
    """Write a take as a take table; two tables when its reference has a clock of its own."""
    file_format = file.suffix.lstrip(".").lower()
    path = f"/takes/{take}/export"
    with connect() as service:
        try:
            tables = {file: service.download(path, {"format": file_format})}
        except ServiceError as error:
            if error.status != CONFLICT:
                raise
            tables = {
                file.with_name(f"{file.stem}.{part}{file.suffix}"): service.download(
                    path, {"format": file_format, "part": part}
                )
                for part in ("frames", "reference")
            }
    for name, content in tables.items():
        name.write_bytes(content)
        out.print(f"Wrote {name}.", markup=False)


@app.command("remove")
def remove(take: str) -> None:
    """Remove a take that no model was trained on."""
    with connect() as service:
        service.delete(f"/takes/{take}")
    out.print(f"Removed take {take}.")


def _beside(frames: Path) -> Path | None:
    """X.reference.csv for X.frames.csv, when it is there."""
    stem, mark, rest = frames.name.rpartition(".frames.")
    partner = frames.with_name(f"{stem}.reference.{rest}")
    return partner if mark and partner.is_file() else None


def _is_reference_of_another(file: Path, files: list[Path]) -> bool:
    return any(_beside(other) == file for other in files if other != file)


def _readable(rows: list[dict]) -> list[dict]:
    return [{**row, "id": row["id"][:12], "measured": len(row["rotations"]) or None} for row in rows]
