"""``glovecal where``: where a model fails, what the error depends on, and how small it could get."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from glovecal_service.cli.connection import connect
from glovecal_service.cli.held_out_takes import HeldOutTakes, held_out_takes, warn_trained_on
from glovecal_service.cli.options import AsJson, Model
from glovecal_service.cli.printing import out, print_json, print_table
from glovecal_service.cli.writing import Overwrite, require_place, write_whole

STRETCHES = {
    "take": "take",
    "when": "seconds",
    "pose": "pose",
    "rmse_deg": "RMSE (deg)",
    "rotation": "worst rotation",
    "rotation_rmse_deg": "its RMSE",
}


def where(
    model: Model,
    take: HeldOutTakes = None,
    report: Annotated[
        Path | None, typer.Option("--report", help="Write a page with pictures to this .html file.")
    ] = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Say where a model fails: each rotation against its noise floor and every recorded column."""
    if report is not None:
        require_place(report, overwrite=overwrite)
    with connect() as service:
        document = service.get(f"/models/{model}")
        takes = held_out_takes(service, [document], take or [])
        body = {"takes": [row["id"] for row in takes]}
        found = service.post(f"/models/{model}/where", body)
        page = service.page(f"/models/{model}/report", body) if report is not None else ""
    if as_json:
        print_json(found)
    else:
        _print(model, document, takes, found)
    if report is not None:
        write_whole({report: page.encode()})


def _print(model: str, document: dict[str, Any], takes: list[dict[str, Any]], found: dict[str, Any]) -> None:
    out.print(f"Model {model[:12]} ({document['method']}) against {', '.join(row['name'] for row in takes)}:")
    for item in found["rotations"]:
        out.print(f"  {item['sentence']}")
        if item["wearings"] is not None:
            out.print(f"    {item['wearings']['sentence']}")
    out.print("\nThe worst seconds:")
    rows = [{**one, "when": f"{one['start_s']:.1f} to {one['end_s']:.1f}"} for one in found["stretches"]]
    print_table(rows, STRETCHES, empty="No take is long enough.")
    warn_trained_on(model, found["trained_on"], takes)
