"""``glovecal model``: a subject's calibration models."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from glovecal_service.cli.connection import connect
from glovecal_service.cli.options import AsJson, Subject
from glovecal_service.cli.printing import out, print_facts, print_json, print_table

app = typer.Typer(help="Calibration models: versions, activation, export.", no_args_is_help=True)

Model = Annotated[str, typer.Argument(help="Model id, or its first 6 or more characters.")]


@app.command("list")
def list_models(
    subject: Annotated[str | None, typer.Option("--subject", "-s")] = None, as_json: AsJson = False
) -> None:
    """List models; the active one of each subject and layout is marked."""
    with connect() as service:
        rows = service.get("/models", {"subject": subject} if subject else None)
    if as_json:
        print_json(rows)
        return
    for row in rows:
        row["short"] = row["id"][:12]
    columns = {
        "short": "model",
        "subject": "subject",
        "layout": "layout",
        "method": "method",
        "held_out_rmse_deg": "held-out error (deg)",
        "active": "active",
        "created_at": "trained",
    }
    print_table(rows, columns, empty="No models yet. Train one: glovecal train --subject NAME")


@app.command("show")
def show(model: Model, as_json: AsJson = False) -> None:
    """Show one model: errors of each rotation, takes, lineage."""
    with connect() as service:
        document = service.get(f"/models/{model}")
    if as_json:
        print_json(document)
        return
    rotations = document.pop("rotations", [])
    print_facts(document)
    out.print()
    columns = {
        "rotation": "rotation",
        "method": "method",
        "held_out_rmse_deg": "held-out error (deg)",
        "samples": "samples",
    }
    print_table(rotations, columns, empty="No rotations.")


@app.command("activate")
def activate(model: Model) -> None:
    """Predict live with this model from the next frame on."""
    with connect() as service:
        service.post(f"/models/{model}/activate")
    out.print(f"Model {model} is active.")


@app.command("rollback")
def rollback(
    subject: Subject, layout: Annotated[str, typer.Option("--layout", "-l")] = "cyberglove18"
) -> None:
    """Return to the model that was active before."""
    with connect() as service:
        document = service.post("/models/rollback", {"subject": subject, "layout": layout})
    out.print(f"Model {document['model'][:12]} is active again.")


@app.command("export")
def export(model: Model, file: Annotated[Path, typer.Argument(help="Where to write the artifact.")]) -> None:
    """Write the model's artifact (safetensors with its manifest inside)."""
    with connect() as service:
        file.write_bytes(service.download(f"/models/{model}/export"))
    out.print(f"Wrote {file}.")
