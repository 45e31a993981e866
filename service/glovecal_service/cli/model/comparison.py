"""``glovecal compare``: models against takes with reference, in numbers."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from glovecal_service.cli.model.ceiling import Ceiling, print_ceiling, wait_for_ceiling
from glovecal_service.cli.model.fingertips import print_fingertips, print_fingertips_beside
from glovecal_service.cli.model.held_out_takes import HeldOutTakes, held_out_takes, warn_trained_on
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.floor_doubts import print_floor_doubts
from glovecal_service.cli.terminal.options import AsJson, Models
from glovecal_service.cli.terminal.printing import err, out, print_json, print_sentences, print_table
from glovecal_service.cli.terminal.writing import Overwrite, Report, fetch_report, require_place, write_report

COLUMNS = {
    "rotation": "rotation",
    "rmse_deg": "RMSE",
    "floor": "floor",
    "mae_deg": "mean",
    "bias_deg": "bias",
    "percentile_95_deg": "95 %",
    "coverage": "in sd",
    "nlpd": "NLPD",
    "baseline_deg": "spread",
    "count": "frames",
}
FLOOR = (
    "95 % interval of the noise floor, how small the RMSE can get on these takes (>: a lower bound; ?: not "
    "reliable)"
)
LEGEND = (
    f"Degrees. floor: {FLOOR}; mean: of |error|; 95 %: of frames are below; in sd: share of errors within "
    "the claimed standard deviation, 0.68 is truthful; NLPD: mean negative log predictive density in nats, "
    "ln(RMSE) + 1.42 for a truthful standard deviation of constant size; spread: the error of always "
    "answering the mean angle."
)
BESIDE_LEGEND = (
    f"floor: {FLOOR}, the smallest of these models; spread: the error of always answering the mean angle."
)
POSES = {"pose": "pose", "mean_deg": "mean |error|", "sd_deg": "sd", "count": "angles"}


def compare(
    model: Models,
    take: HeldOutTakes = None,
    poses: Annotated[bool, typer.Option("--poses", help="Errors of each pose too.")] = False,
    ceiling: Ceiling = False,
    report: Report = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Hold models against measurements; several models are shown side by side."""
    if report is not None:
        require_place(report, overwrite=overwrite)
    with connect() as service:
        documents = {name: service.get(f"/models/{name}") for name in dict.fromkeys(model)}
        takes = held_out_takes(service, list(documents.values()), take or [])
        body = {"takes": [row["id"] for row in takes]}
        for name in documents if ceiling else ():
            wait_for_ceiling(service, name, quiet=as_json)
        results = {name: service.post(f"/models/{name}/compare", body) for name in documents}
        page = fetch_report(service, list(documents), takes) if report is not None else b""
    if report is not None:
        write_report(report, page, as_json=as_json)
    if as_json:
        print_json(results)
    else:
        _print(documents, takes, results, poses=poses)


def _print(
    documents: dict[str, dict[str, Any]],
    takes: list[dict[str, Any]],
    results: dict[str, dict[str, Any]],
    *,
    poses: bool,
) -> None:
    out.print(f"Against {', '.join(row['name'] for row in takes)}:")
    for name, result in results.items():
        of_model = "" if len(results) == 1 else f"Model {name[:12]}: "
        print_sentences(result["sentences"], of_model)
    if len(results) == 1:
        rows = [{**row, "floor": _interval(row["floor"])} for row in _rows(next(iter(results.values())))]
        print_table(rows, COLUMNS, empty="Nothing was measured.")
        err.print(LEGEND)
        print_floor_doubts({row["rotation"]: row["floor"] for row in _rows(next(iter(results.values())))[1:]})
        [(name, result)] = results.items()
        print_fingertips(result["fingertips"], documents[name]["subject"])
    else:
        _print_side_by_side(documents, results)
    if poses:
        for name, result in results.items():
            out.print(f"\nModel {name[:12]} ({documents[name]['method']}), each pose:")
            print_table(result["poses"], POSES, empty="No frame of these takes has the name of a pose.")
    for name, result in results.items():
        print_ceiling(result["ceiling"])
        _warn(name, result, takes)


def _rows(result: dict[str, Any]) -> list[dict[str, Any]]:
    rotations = [{"rotation": key, **value} for key, value in result["rotations"].items()]
    return [{"rotation": "all", **result["overall"]}, *rotations] if rotations else []


def _interval(floor: dict[str, Any] | None) -> str | None:
    if floor is None:
        return None
    doubt = "" if floor["is_reliable"] else "?"
    if floor["is_lower_bound"]:
        return f">{floor['floor_deg']:.2f}{doubt}"
    return f"{floor['low_deg']:.2f}-{floor['high_deg']:.2f}{doubt}"


def _print_side_by_side(documents: dict[str, dict[str, Any]], results: dict[str, dict[str, Any]]) -> None:
    measured = {model: {row["rotation"]: row for row in _rows(result)} for model, result in results.items()}
    rows: list[dict[str, Any]] = []
    for name in dict.fromkeys(name for of_model in measured.values() for name in of_model):
        errors = {model: of_model[name] for model, of_model in measured.items() if name in of_model}
        floors = [row["floor"] for row in errors.values() if row["floor"] is not None]
        floor = _interval(
            min(floors, key=lambda one: (one["is_lower_bound"], one["floor_deg"]), default=None)
        )
        spread = next(iter(errors.values()))["baseline_deg"]
        rmse = {model: row["rmse_deg"] for model, row in errors.items()}
        rows.append({"rotation": name, **rmse, "floor": floor, "spread": spread})
    headings = {name: f"{document['method']} {name[:6]}" for name, document in documents.items()}
    columns = {"rotation": "RMSE (deg)", **headings, "floor": "floor", "spread": "spread"}
    print_table(rows, columns, empty="Nothing was measured.")
    err.print(BESIDE_LEGEND)
    print_fingertips_beside({name: result["fingertips"] for name, result in results.items()}, headings)


def _warn(name: str, result: dict[str, Any], takes: list[dict[str, Any]]) -> None:
    warn_trained_on(name, result["trained_on"], takes)
    if result["excluded"]:
        frames = ", ".join(f"{count} frames of {rotation}" for rotation, count in result["excluded"].items())
        err.print(f"Not compared, because the sensor failed or frames were repeated: {frames}.")
    if result["not_predicted"]:
        err.print(f"Model {name[:12]} does not predict {', '.join(result['not_predicted'])}.", style="yellow")
