"""``glovecal where``: where a model fails, what the error depends on, and how small it could get."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from glovecal_service.cli.model.ceiling import Ceiling, print_ceiling, wait_for_ceiling
from glovecal_service.cli.model.held_out_takes import HeldOutTakes, held_out_takes, warn_trained_on
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, Model
from glovecal_service.cli.terminal.printing import err, out, print_json, print_table
from glovecal_service.cli.terminal.writing import Overwrite, Report, fetch_report, require_place, write_report

FLOORS = {
    "rotation": "rotation",
    "rmse_deg": "RMSE",
    "still hand": "still hand",
    "still joint": "still joint",
    "repeated poses": "repeated poses",
    "spectrum": "> spectrum",
    "frame to frame": "> frame to frame",
    "near readings": "near readings",
    "stated": "stated by the camera",
    "slow": "slow",
}
FLOORS_LEGEND = (
    "Degrees; the leftmost estimate of a row counts; >: a lower bound; --json has the intervals. slow: "
    "percent of the error's variance below 1 Hz."
)
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
    floors: Annotated[
        bool, typer.Option("--floors", help="Every estimate of the noise floors, and how slow errors are.")
    ] = False,
    cross_validation: Annotated[
        bool,
        typer.Option(
            "--cross-validation",
            help="Also train two models on disjoint halves of the training takes, and show where they differ "
            "by more than they claim.",
        ),
    ] = False,
    ceiling: Ceiling = False,
    report: Report = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Say where a model fails: each rotation against its noise floor and every recorded column."""
    if report is not None:
        require_place(report, overwrite=overwrite)
    with connect() as service:
        document = service.get(f"/models/{model}")
        takes = held_out_takes(service, [document], take or [], else_trained_on=True)
        body = {"takes": [row["id"] for row in takes], "cross_validation": cross_validation}
        if ceiling:
            wait_for_ceiling(service, model, quiet=as_json)
        found = service.post(f"/models/{model}/where", body)
        page = fetch_report(service, [model], takes) if report is not None else b""
    if report is not None:
        write_report(report, page, as_json=as_json)
    if as_json:
        print_json(found)
    else:
        _print(model, document, takes, found, floors=floors)


def _print(
    model: str,
    document: dict[str, Any],
    takes: list[dict[str, Any]],
    found: dict[str, Any],
    *,
    floors: bool,
) -> None:
    out.print(f"Model {model[:12]} ({document['method']}) against {', '.join(row['name'] for row in takes)}:")
    for item in found["rotations"]:
        out.print(f"  {item['sentence']}")
        if item["wearings"] is not None:
            out.print(f"    {item['wearings']['sentence']}")
    for sentence in found["sentences"]:
        out.print(sentence)
    if floors:
        _print_floors(found)
    out.print("\nThe worst seconds:")
    rows = [{**one, "when": f"{one['start_s']:.1f} to {one['end_s']:.1f}"} for one in found["stretches"]]
    print_table(rows, STRETCHES, empty="No take is long enough.")
    print_ceiling(found["ceiling"])
    warn_trained_on(model, found["trained_on"], takes)


def _print_floors(found: dict[str, Any]) -> None:
    rows = []
    for item in found["rotations"]:
        every = [item["floor"], *item["other_floors"]] if item["floor"] is not None else []
        slow = round(100 * item["slow"]["share"]) if item["slow"] is not None else None
        estimates = {one["how"]: one["floor_deg"] for one in every}
        rows.append({"rotation": item["rotation"], "rmse_deg": item["rmse_deg"], **estimates, "slow": slow})
    out.print("\nNoise floors:")
    print_table(rows, FLOORS, empty="Nothing was measured.")
    err.print(FLOORS_LEGEND)
