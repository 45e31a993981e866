"""``glovecal diagnose``: which physical effect a model lacks, with evidence, and what to do next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import typer

from glovecal_service.cli.take.rows import find_takes
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, Model
from glovecal_service.cli.terminal.printing import err, out, print_json, print_table, text
from glovecal_service.cli.terminal.waiting import wait_for_job
from glovecal_service.cli.terminal.writing import (
    Overwrite,
    Report,
    fetch_job_report,
    require_place,
    write_report,
)
from glovecal_service.next_command import next_command

CANDIDATES_SHOWN = 6
ROTATIONS = {"rotation": "rotation", "rmse_deg": "error", "noise_floor_deg": "noise floor"}
CANDIDATES = {
    "effect": "effect",
    "where": "where",
    "rmse_before_deg": "error",
    "rmse_after_deg": "with it",
    "rmse_decoy_deg": "with its decoy",
    "passes": "beyond chance",
}
GOES_WITH = {
    "phrase": "what is left goes with",
    "rotation": "rotation",
    "size_deg": "explains, degrees",
    "probability": "chance, all columns counted",
}
LEGEND = (
    "Degrees, on takes left out, readings and reference smoothed alike. A decoy has the same freedom as its "
    "effect and cannot be right: what it saves, flexibility saves."
)
Expressions = Annotated[
    list[str] | None,
    typer.Option("--expression", "-e", help="An effect of your own to try too (docs/own-effect.md); repeat."),
]


def diagnose(
    model: Model,
    take: Annotated[
        list[str] | None,
        typer.Option("--take", "-t", help="Take to look at; repeat. Default: those it was trained on."),
    ] = None,
    expression: Expressions = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the decoys.")] = 0,
    report: Report = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Find which physical effect a model lacks, or say why that cannot be known from these takes."""
    if report is not None:
        require_place(report, overwrite=overwrite)
    with connect() as service:
        document = service.get(f"/models/{model}")
        rows = find_takes(service.get("/takes"), take or [])
        body: dict[str, Any] = {"takes": [row["id"] for row in rows] or None, "seed": seed}
        body["effects"] = [{"declaration": item} for item in expression or []]
        job = service.post(f"/models/{model}/diagnose", body)["id"]
        found = wait_for_job(service, job, quiet=as_json)["result"]
        page = fetch_job_report(service, job) if report is not None else b""
    if report is not None:
        write_report(report, page, as_json=as_json)
    if as_json:
        print_json(found)
    else:
        takes = found.get("takes") or []
        out.print(f"Model {model[:12]} ({document['method']}) of {document['subject']}, {len(takes)} takes:")
        print_diagnosis(found)
        out.print(f"\nNext: {next_command(document['id'], found)}")


def print_diagnosis(found: Mapping[str, Any]) -> None:
    """For people, the measurement itself first."""
    _say("The reference first:", found.get("reference_problems"))
    _say("Found in the recording:", [item["sentence"] for item in found.get("findings") or ()])
    rotations = found.get("rotations") or {}
    out.print()
    rows = [{"rotation": name, **values} for name, values in rotations.items()]
    print_table(rows, ROTATIONS, empty="Nothing was measured.")
    if found.get("hold_drift"):
        out.print(f"\n{found['hold_drift']['sentence']}")
    else:
        _print_named(found.get("named"))
    _print_candidates(found.get("candidates") or ())
    why = reasons(found.get("not_judgeable") or ())
    _say("Cannot be judged from these takes:", why)
    left, following = found.get("something_left") or {}, found.get("next_take")
    if left.get("sentence"):
        out.print(f"\n{left['sentence']}")
    if left.get("goes_with"):
        print_table(left["goes_with"], GOES_WITH, empty="")
    if following:
        rivals = " and ".join(following.get("separates") or ())
        out.print(f"\nTo tell {rivals} apart record {following['seconds']} s: {following['what']}")


def reasons(not_judgeable: Sequence[Mapping[str, Any]]) -> list[str]:
    """Effects and why they cannot be judged, those with the same reason together."""
    by_why: dict[str, list[str]] = {}
    for item in not_judgeable:
        by_why.setdefault(item["why"], []).append(item["effect"])
    return [f"{', '.join(effects)}: {why}" for why, effects in by_why.items()]


def _print_named(named: Mapping[str, Any] | None) -> None:
    out.print()
    if named is None:
        out.print(
            "Missing: nothing that can be named. No known effect saves more than its decoy and chance do."
        )
        return
    out.print(f"Missing: {named['sentence']}")
    for rotation, values in (named.get("parameters") or {}).items():
        if values:
            out.print(f"  {rotation}: {text(values)}")


def _print_candidates(candidates: Sequence[Mapping[str, Any]]) -> None:
    if not candidates:
        return
    passing = sum(bool(item.get("passes")) for item in candidates)
    shown = candidates[: max(CANDIDATES_SHOWN, passing)]
    out.print("\nWhat was tried:" if len(shown) == len(candidates) else "\nWhat was tried, the best:")
    print_table(shown, CANDIDATES, empty="", folds="where")
    err.print(LEGEND)


def _say(heading: str, sentences: Sequence[str] | None) -> None:
    if sentences:
        out.print(f"\n{heading}")
        for sentence in sentences:
            out.print(f"  {sentence}")
