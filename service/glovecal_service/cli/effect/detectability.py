"""``glovecal detectable``: what these takes could have shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from glovecal_models.hand.handedness import Handedness
from glovecal_service.cli.effect.diagnosis import Expressions, reasons
from glovecal_service.cli.take.rows import find_takes, takes_of
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, OnlyHand
from glovecal_service.cli.terminal.printing import err, out, print_json, print_table
from glovecal_service.cli.terminal.refusal import Refusal
from glovecal_service.cli.terminal.waiting import wait_for_job
from glovecal_service.cli.terminal.writing import (
    Overwrite,
    Report,
    fetch_job_report,
    require_place,
    write_report,
)

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

SIZES = "0.5,1,2,4"
PAIRS_SHOWN = 8
PAIRS = {"pair": "effects", "rotation": "rotation", "correlation": "correlation", "own": "own part (%)"}
LEGEND = (
    "Size: RMS degrees of what is put in and no static map explains. Of the trials: named alone + named with "
    "others; then the sizes that half and 80 % of the trials name alone (interpolated)."
)


def detectable(
    who: Annotated[
        str, typer.Argument(metavar="SUBJECT_OR_MODEL", help="A subject's name, or a model's id.")
    ],
    effect: Annotated[
        list[str] | None,
        typer.Option("--effect", help="Effect to put in; repeat. Default: all that a diagnosis compares."),
    ] = None,
    rotation: Annotated[
        list[str] | None,
        typer.Option(
            "--rotation", "-r", help="Put it into this rotation alone; repeat. Default: into all at once."
        ),
    ] = None,
    sizes: Annotated[str, typer.Option("--sizes", help="Sizes in degrees RMS, separated by commas.")] = SIZES,
    trials: Annotated[int, typer.Option(min=1, max=50, help="Trials for each size.")] = 3,
    take: Annotated[
        list[str] | None,
        typer.Option("--take", "-t", help="Take to look at; repeat. Default: the model's, or all measured."),
    ] = None,
    hand: OnlyHand = None,
    expression: Expressions = None,
    seed: Annotated[int, typer.Option(min=0, help="Of noise, weights and controls.")] = 0,
    report: Report = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Say how large an effect must be to be named in these takes, and which effects they cannot tell apart.

    The effect is put into the session's own readings, made perfect otherwise, with their noise as measured,
    and diagnosed again. One effect takes about half a minute for each rotation.
    """
    if report is not None:
        require_place(report, overwrite=overwrite)
    body: dict[str, Any] = {
        "effects": effect or None,
        "declarations": [{"declaration": item} for item in expression or []],
        "rotations": rotation or None,
        "sizes_deg": _sizes(sizes),
        "trials": trials,
        "seed": seed,
    }
    with connect() as service:
        address, chosen = _where(service, who, take or [], hand)
        job = service.post(address, body | chosen)["id"]
        found = wait_for_job(service, job, quiet=as_json)["result"]
        page = fetch_job_report(service, job) if report is not None else b""
    if report is not None:
        write_report(report, page, as_json=as_json)
    if as_json:
        print_json(found)
    else:
        _print(found)


def _sizes(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",") if part.strip()]
    except ValueError as error:
        raise typer.BadParameter(
            f"{text!r} is no list of sizes such as {SIZES}", param_hint="--sizes"
        ) from error


def _where(
    service: RestClient, who: str, takes: Sequence[str], hand: Handedness | None
) -> tuple[str, dict[str, Any]]:
    """The address to post to, and the takes."""
    subject = who.lower()
    if subject not in {row["name"] for row in service.get("/subjects")}:
        rows = find_takes(service.get("/takes"), takes)
        return f"/models/{who}/detectability", {"takes": [row["id"] for row in rows] or None}
    rows = service.get("/takes", {"subject": subject})
    rows = find_takes(rows, takes) if takes else [row for row in takes_of(rows, hand) if row["rotations"]]
    layouts = sorted({row["layout"] for row in rows})
    if not rows:
        raise Refusal(f"subject {subject} has no take with reference angles; import some with take import")
    if len(layouts) > 1:
        raise Refusal(f"the takes have layouts {', '.join(layouts)}; choose some with --take")
    chosen = {"layout": layouts[0], "takes": [row["id"] for row in rows]}
    return f"/subjects/{subject}/detectability", chosen


def _print(found: Mapping[str, Any]) -> None:
    of = f"model {found['model'][:12]} of {found['subject']}" if found["model"] else found["subject"]
    simulated = ", of a simulated glove" if found["simulated"] else ""
    out.print(f"What {len(found['takes'])} takes of {of} could have shown{simulated}:")
    shown = [item for item in found["effects"] if item["why_not"] is None]
    if shown:
        sizes = [f"{size['size_deg']:g}°" for size in shown[0]["sizes"]]
        columns = {"effect": "effect", "where": "on", **{size: size for size in sizes}}
        columns |= {"named_50_deg": "50 % (°)", "named_80_deg": "80 % (°)"}
        out.print()
        print_table([_row(item) for item in shown], columns, empty="", folds="where")
        err.print(LEGEND)
    noise = ", ".join(f"{name} {value:.2f}" for name, value in found["residual_deg"].items() if value)
    out.print(f"\nNoise and nuisance as measured (° RMS): {noise}")
    for item in shown:
        out.print(item["sentence"])
    refused = [{"effect": item["effect"], "why": item["why_not"]} for item in found["effects"]]
    for line in dict.fromkeys(reasons([item for item in refused if item["why"] is not None])):
        out.print(f"Not shown at any size: {line}")
    out.print(found["control"]["sentence"])
    alike = found["confusability"]
    rows = [
        {
            "pair": " and ".join(pair["effects"]),
            "rotation": pair["rotation"],
            "correlation": pair["correlation"],
            "own": round(100 * (1 - min(pair["correlation"], 1.0) ** 2) ** 0.5),
        }
        for pair in alike["pairs"]
    ]
    confused = sum(pair["is_confused"] for pair in alike["pairs"])
    out.print("\nEffects most alike in these takes, before anything is named:")
    print_table(rows[: max(PAIRS_SHOWN, confused)], PAIRS, empty="Fewer than two effects can be shown.")
    for sentence in alike["sentences"]:
        out.print(sentence)


def _row(item: Mapping[str, Any]) -> dict[str, Any]:
    from glovecal_service.views.detectability import size_text  # brings the mathematics with it

    row = {
        "effect": item["effect"],
        "where": ", ".join(item["rotations"]),
        "named_50_deg": size_text(item, item["named_50_deg"]),
        "named_80_deg": size_text(item, item["named_80_deg"]),
    }
    for size in item["sizes"]:
        also = f"+{size['ambiguous']}" if size["ambiguous"] else ""
        cell = f"{size['named']}{also} of {size['trials']}" if size["trials"] else "-"
        row[f"{size['size_deg']:g}°"] = cell
    return row
