"""``glovecal train``: a calibration model from a subject's takes."""

from __future__ import annotations

from typing import Annotated

import typer

from glovecal_service.cli.connection import connect
from glovecal_service.cli.options import AsJson, LayoutName, Subject
from glovecal_service.cli.printing import err, out, print_json
from glovecal_service.cli.waiting import wait_for_job


def train(
    subject: Subject,
    layout: LayoutName = None,
    method: Annotated[str, typer.Option(help="linear, lmc_gpr or spgp.")] = "lmc_gpr",
    take: Annotated[
        list[str] | None, typer.Option(help="Take to train on; repeat. Default: all with reference.")
    ] = None,
    leave_out: Annotated[list[str] | None, typer.Option(help="Take to keep for testing; repeat.")] = None,
    pseudo_inputs: Annotated[int, typer.Option(help="SPGP's number of pseudo-inputs.")] = 100,
    samples: Annotated[int, typer.Option(help="Most samples for one rotation; fewer train faster.")] = 2000,
    folds: Annotated[
        int, typer.Option(help="Held-out folds for the error estimate; 0: no estimate, fastest.")
    ] = 3,
    activate: Annotated[bool, typer.Option(help="Predict live with the new model.")] = True,
    as_json: AsJson = False,
) -> None:
    """Train a calibration model; the error it prints is on takes left out of training."""
    with connect() as service:
        chosen, layout = _choose(service, subject, layout, take or [], leave_out or [])
        job = service.post(
            "/models/train",
            {
                "subject": subject,
                "layout": layout,
                "method": method,
                "takes": chosen,
                "activate": activate,
                "pseudo_inputs": pseudo_inputs,
                "samples": samples,
                "folds": folds,
            },
        )
        result = wait_for_job(service, job["id"], quiet=as_json)["result"]
        document = service.get(f"/models/{result['model']}")
    if as_json:
        print_json({"result": result, "model": document})
        return
    for sentence in result.get("sentences", []):
        err.print(sentence, markup=False)
    error = result.get("held_out_rmse_deg")
    out.print(
        f"Model {result['model'][:12]} ({method}) for {subject}, "
        + (f"error on left-out takes {error:.2f} degrees." if error is not None else "error not estimated.")
        + (" Active." if activate else " Not active.")
    )


def _choose(service, subject: str, layout: str | None, wanted: list[str], left_out: list[str]):
    """Ids of the takes to train on, and their layout."""
    rows = [row for row in service.get("/takes", {"subject": subject}) if row["rotations"]]
    rows = [row for row in rows if layout in (None, row["layout"])]
    if wanted:
        rows = [row for row in rows if _is_named(row, wanted)]
    rows = [row for row in rows if not _is_named(row, left_out)]
    layouts = sorted({row["layout"] for row in rows})
    if len(layouts) > 1:
        raise typer.BadParameter(f"the takes have layouts {', '.join(layouts)}; choose one with --layout")
    if not layouts:
        raise typer.BadParameter(f"subject {subject} has no such takes with reference angles")
    return [row["id"] for row in rows], layouts[0]


def _is_named(row: dict, names: list[str]) -> bool:
    return any(row["name"] == name or row["id"].startswith(name) for name in names)
