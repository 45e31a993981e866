"""``glovecal diagnose``: missing effects of a model, with evidence, and what to do next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import typer

from glovecal_service.cli.model.ceiling import Ceiling, print_ceiling, wait_for_ceiling
from glovecal_service.cli.take.rows import find_takes
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.floor_doubts import print_floor_doubts
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
    "rmse_control_deg": "with control",
    "passes": "significant",
}
ASSOCIATIONS = {
    "phrase": "residual is associated with",
    "rotation": "rotation",
    "size_deg": "explains (°)",
    "p_value": "p, corrected",
}
LEGEND = (
    "Errors of what the sensors read, in degrees, on held-out takes, readings and reference identically "
    "smoothed; not the model's error of angles. A control has the same freedom as its effect and cannot be "
    "right: what it saves, flexibility saves. Noise floors are of errors that are not smoothed."
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
    seed: Annotated[int, typer.Option(min=0, help="Of the controls.")] = 0,
    ceiling: Ceiling = False,
    report: Report = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Find which physical effect a model is missing, or why these takes cannot tell."""
    if report is not None:
        require_place(report, overwrite=overwrite)
    with connect() as service:
        document = service.get(f"/models/{model}")
        rows = find_takes(service.get("/takes"), take or [])
        body: dict[str, Any] = {"takes": [row["id"] for row in rows] or None, "seed": seed}
        if ceiling:
            wait_for_ceiling(service, model, [row["id"] for row in rows], quiet=as_json)
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
        print_ceiling(found.get("ceiling"))
        out.print(f"\nNext: {next_command(document['id'], found, document['subject'], document['hand'])}")


def print_diagnosis(found: Mapping[str, Any]) -> None:
    """For people, the measurement itself first."""
    _print_sentences("Set aside:", [item["sentence"] for item in found.get("odd_takes") or ()])
    _print_sentences("Excluded from the reference:", found.get("excluded"))
    _print_sentences("Check the reference first:", found.get("reference_problems"))
    _print_sentences("Found in the recording:", [item["sentence"] for item in found.get("findings") or ()])
    rotations = found.get("rotations") or {}
    out.print()
    rows = [{"rotation": name, **values} for name, values in rotations.items()]
    print_table(rows, ROTATIONS, empty="Nothing was measured.")
    print_floor_doubts({name: values.get("floor") for name, values in rotations.items()})
    if found.get("hold_drift"):
        out.print(f"\n{found['hold_drift']['sentence']}")
    else:
        _print_named(found.get("named"))
    _print_candidates(found.get("candidates") or ())
    why = reasons(found.get("not_identifiable") or ())
    _print_sentences("Not identifiable from these takes:", why)
    residual, following = found.get("unexplained_residual") or {}, found.get("next_take")
    if residual.get("sentence"):
        out.print(f"\n{residual['sentence']}")
    if residual.get("associations"):
        print_table(residual["associations"], ASSOCIATIONS, empty="")
    _print_sentences(
        "What these associations ask for:", [item["sentence"] for item in found.get("actions") or ()]
    )
    if following:
        rivals = " and ".join(following.get("separates") or ())
        out.print(f"\nTo separate {rivals}, record {following['seconds']} s: {following['what']}")


def reasons(not_identifiable: Sequence[Mapping[str, Any]]) -> list[str]:
    """Effects and why they are not identifiable, those with the same reason together."""
    by_why: dict[str, list[str]] = {}
    for item in not_identifiable:
        by_why.setdefault(item["why"], []).append(item["effect"])
    return [f"{', '.join(effects)}: {why}" for why, effects in by_why.items()]


def _print_named(named: Mapping[str, Any] | None) -> None:
    out.print()
    if named is None:
        out.print("Missing: no known effect beats its control significantly.")
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
    out.print("\nEffects tried:" if len(shown) == len(candidates) else "\nEffects tried, the best:")
    print_table(shown, CANDIDATES, empty="", folds="where")
    err.print(LEGEND)


def _print_sentences(heading: str, sentences: Sequence[str] | None) -> None:
    if sentences:
        out.print(f"\n{heading}")
        for sentence in sentences:
            out.print(f"  {sentence}")
