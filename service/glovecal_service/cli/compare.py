"""``glovecal compare``: models against takes with reference, in numbers."""

from __future__ import annotations

from typing import Annotated

import typer

from glovecal_service.cli.connection import connect
from glovecal_service.cli.options import AsJson
from glovecal_service.cli.printing import err, out, print_json, print_table

COLUMNS = {
    "rotation": "rotation",
    "rmse_deg": "RMSE",
    "mae_deg": "mean |error|",
    "bias_deg": "bias",
    "percentile_95_deg": "95 % below",
    "coverage": "within 1 sd (0.68 is truthful)",
    "baseline_deg": "its own spread",
    "count": "frames",
}


def compare(
    model: Annotated[list[str], typer.Argument(help="Model ids, or their first 6 or more characters.")],
    take: Annotated[list[str], typer.Option("--take", "-t", help="Take to compare with; repeat.")],
    as_json: AsJson = False,
) -> None:
    """Hold models against measurements. All figures in degrees; "its own spread" is the error of no model."""
    with connect() as service:
        takes = [_take_id(service, name) for name in take]
        results = {name: service.post(f"/models/{name}/compare", {"takes": takes}) for name in model}
    if as_json:
        print_json(results)
        return
    for name, result in results.items():
        rows = [{"rotation": "all", **result["over_all"]}]
        rows += [{"rotation": key, **value} for key, value in result["rotations"].items()]
        out.print(f"Model {name}, degrees:", markup=False)
        print_table(rows, COLUMNS, empty="Nothing was measured.")
        for key in result.get("trained_on", []):
            err.print(
                f"Careful: the model was trained on take {key}; this is not a held-out error.", style="yellow"
            )
        out.print()


def _take_id(service, name: str) -> str:
    matches = [
        row["id"] for row in service.get("/takes") if row["name"] == name or row["id"].startswith(name)
    ]
    if len(matches) != 1:
        raise typer.BadParameter(f"{len(matches)} takes are called {name!r}; give a take's id")
    return matches[0]
