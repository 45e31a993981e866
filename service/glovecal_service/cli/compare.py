"""``glovecal compare``: models against takes with reference, in numbers."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from glovecal_service.cli.connection import connect
from glovecal_service.cli.held_out_takes import HeldOutTakes, held_out_takes, warn_trained_on
from glovecal_service.cli.options import AsJson, Models
from glovecal_service.cli.printing import err, out, print_json, print_table

COLUMNS = {
    "rotation": "rotation",
    "rmse_deg": "RMSE",
    "mae_deg": "mean",
    "bias_deg": "bias",
    "percentile_95_deg": "95 %",
    "coverage": "in 1 sd",
    "baseline_deg": "spread",
    "count": "frames",
}
LEGEND = (
    "Degrees. mean: of |error|; 95 %: of the frames are below; in 1 sd: share of errors within the "
    "claimed standard deviation, 0.68 is truthful; spread: the error of always answering the mean angle."
)
POSES = {"pose": "pose", "mean_deg": "mean |error|", "sd_deg": "sd", "count": "angles"}


def compare(
    model: Models,
    take: HeldOutTakes = None,
    poses: Annotated[bool, typer.Option("--poses", help="Errors of each pose too.")] = False,
    as_json: AsJson = False,
) -> None:
    """Hold models against measurements; several models are shown side by side."""
    with connect() as service:
        documents = {name: service.get(f"/models/{name}") for name in dict.fromkeys(model)}
        takes = held_out_takes(service, list(documents.values()), take or [])
        body = {"takes": [row["id"] for row in takes]}
        results = {name: service.post(f"/models/{name}/compare", body) for name in documents}
    if as_json:
        print_json(results)
        return
    out.print(f"Against {', '.join(row['name'] for row in takes)}:")
    if len(results) == 1:
        print_table(_rows(next(iter(results.values()))), COLUMNS, empty="Nothing was measured.")
        err.print(LEGEND)
    else:
        _print_side_by_side(documents, results)
    if poses:
        for name, result in results.items():
            out.print(f"\nModel {name[:12]} ({documents[name]['method']}), each pose:")
            print_table(result["poses"], POSES, empty="No frame of these takes has the name of a pose.")
    for name, result in results.items():
        _warn(name, result, takes)


def _rows(result: dict[str, Any]) -> list[dict[str, Any]]:
    rotations = [{"rotation": key, **value} for key, value in result["rotations"].items()]
    return [{"rotation": "all", **result["over_all"]}, *rotations] if rotations else []


def _print_side_by_side(documents: dict[str, dict[str, Any]], results: dict[str, dict[str, Any]]) -> None:
    names = dict.fromkeys(row["rotation"] for result in results.values() for row in _rows(result))
    rows: list[dict[str, Any]] = [{"rotation": name} for name in names]
    for model, result in results.items():
        errors = {row["rotation"]: row for row in _rows(result)}
        for row in rows:
            measured = errors.get(row["rotation"], {})
            row[model] = measured.get("rmse_deg")
            row["spread"] = measured.get("baseline_deg", row.get("spread"))
    headings = {name: f"{document['method']} {name[:6]}" for name, document in documents.items()}
    print_table(
        rows, {"rotation": "RMSE (deg)", **headings, "spread": "spread"}, empty="Nothing was measured."
    )
    err.print("spread: the error of always answering the mean angle.")


def _warn(name: str, result: dict[str, Any], takes: list[dict[str, Any]]) -> None:
    warn_trained_on(name, result["trained_on"], takes)
    if result["not_predicted"]:
        err.print(f"Model {name[:12]} does not predict {', '.join(result['not_predicted'])}.", style="yellow")
