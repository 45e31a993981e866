"""``glovecal train``: a calibration model from a subject's takes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from glovecal_models.hand.handedness import Handedness
from glovecal_service.cli.take.rows import find_takes, takes_of
from glovecal_service.cli.terminal.connection import connect, is_remote
from glovecal_service.cli.terminal.options import AsJson, OnlyHand, OnlyLayout, Subject
from glovecal_service.cli.terminal.printing import err, out, print_json, print_sentences
from glovecal_service.cli.terminal.refusal import Refusal
from glovecal_service.cli.terminal.waiting import wait_for_job

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

Method = Literal[
    "raw", "linear", "lmc_gpr", "spgp", "auto", "polynomial_gpr", "general_gpr", "two_shapes", "template"
]


def train(
    subject: Subject,
    layout: OnlyLayout = None,
    method: Annotated[
        Method,
        typer.Option(
            help="auto chooses each rotation's kernel by evidence and error, for hardware nobody knows. "
            "raw is no calibration at all: the scale to read the others against. template is a scale and an "
            "offset for each sensor and the palm's part, from five hand shapes; two_shapes is the glove "
            "maker's line through two."
        ),
    ] = "lmc_gpr",
    take: Annotated[
        list[str] | None,
        typer.Option(
            "--take", "-t", help="Take to train on; repeat. Default: all with reference or touches."
        ),
    ] = None,
    leave_out: Annotated[list[str] | None, typer.Option(help="Take to keep for testing; repeat.")] = None,
    hand: OnlyHand = None,
    pseudo_inputs: Annotated[
        int, typer.Option(min=2, max=1000, help="SPGP's number of pseudo-inputs.")
    ] = 100,
    samples: Annotated[
        int, typer.Option(min=10, max=5000, help="Most samples for one rotation; fewer train faster.")
    ] = 2000,
    folds: Annotated[
        int,
        typer.Option(min=0, max=20, help="Held-out folds for the error estimate; 0: no estimate, fastest."),
    ] = 3,
    seed: Annotated[int, typer.Option(min=0, help="Of what is chosen at random.")] = 0,
    keep_dead: Annotated[
        bool,
        typer.Option("--keep-dead", help="Refuse sensors that never move instead of leaving them out."),
    ] = False,
    prior: Annotated[
        str | None, typer.Option(help="Linear model, such as a template, as the mean of lmc_gpr.")
    ] = None,
    activate: Annotated[bool, typer.Option(help="Predict live with the new model.")] = True,
    wait: Annotated[bool, typer.Option(help="Wait for the model, else only start the job.")] = True,
    as_json: AsJson = False,
) -> None:
    """Train a calibration model; the error it prints is on takes left out of training.

    Ctrl-C cancels the job; what it finished is kept for the next try.
    """
    if folds == 1:
        raise typer.BadParameter("--folds 1 would hold out everything; give 0, or 2 or more")
    if not wait and not is_remote():
        raise typer.BadParameter(
            "--no-wait needs a service that goes on after this command: set GLOVECAL_URL"
        )
    with connect() as service:
        chosen, layout = _choose(service, subject, layout, hand, take or [], leave_out or [], method)
        body: dict[str, Any] = {"subject": subject, "layout": layout, "method": method, "takes": chosen}
        body |= {"activate": activate, "pseudo_inputs": pseudo_inputs, "samples": samples}
        body |= {"folds": folds, "seed": seed, "keep_dead": keep_dead}
        body |= {"prior": prior} if prior else {}
        job = service.post("/models/train", body)
        if not wait:
            _say_job(job, as_json)
            return
        result = wait_for_job(service, job["id"], quiet=as_json)["result"]
        document = service.get(f"/models/{result['model']}")
    if as_json:
        print_json({"result": result, "model": document})
    else:
        _say_model(result, document)


def _say_job(job: dict[str, Any], as_json: bool) -> None:
    if as_json:
        print_json(job)
    else:
        out.print(f"Job {job['id']} is {job['state']}; wait for it with glovecal job wait {job['id']}")


def _say_model(result: dict[str, Any], document: dict[str, Any]) -> None:
    from glovecal_models.calibration.training_settings import OF_SHAPES

    for sentence in result.get("sentences", []):
        err.print(sentence)
    error = result.get("held_out_rmse_deg")
    how = str(document["error_estimate"].get("how"))
    told = f"held-out error {error:.2f} degrees" if error is not None else "no cross-validation"
    if error is not None and "takes" not in how:
        told = f"error on left-out parts of its takes {error:.2f} degrees"
    if error is not None and "widgets" in how:
        told = f"error on widgets left out, one at a time, {error:.2f} degrees"
    active = "Active." if document["active"] else "Not active."
    out.print(
        f"Model {document['id'][:12]} ({document['method']}) for {document['subject']}, {told}. {active}"
    )
    print_sentences((document["unseen_wearing"] or {}).get("sentences", ()))
    if document["method"] not in OF_SHAPES:
        out.print(f"Next: glovecal diagnose {document['id'][:12]}")


def _choose(
    service: RestClient,
    subject: str,
    layout: str | None,
    hand: Handedness | None,
    wanted: list[str],
    left_out: list[str],
    method: str,
) -> tuple[list[str], str]:
    """Ids of the takes to train on, and their layout."""
    from glovecal_models.calibration.training_settings import OF_SHAPES

    service.get(f"/subjects/{subject}")
    rows = service.get("/takes", {"subject": subject})
    without = {row["id"] for row in find_takes(rows, left_out)}
    teaching = [row for row in rows if row["teaches"] or (row["hand_shape"] and method in OF_SHAPES)]
    chosen = find_takes(rows, wanted) or takes_of(teaching, hand)
    for row in chosen:
        if row not in teaching:
            raise Refusal(
                f"take {row['name']} ({row['id']}) has no reference angles; attach some with "
                f"glovecal take reference {row['id']} FILE"
            )
    chosen = [row for row in chosen if row["id"] not in without and layout in (None, row["layout"])]
    layouts = sorted({row["layout"] for row in chosen})
    if len(layouts) > 1:
        raise Refusal(f"the takes have layouts {', '.join(layouts)}; choose one with --layout")
    if not layouts:
        of_layout = f" with layout {layout}" if layout else ""
        besides = " besides those left out" if without else ""
        raise Refusal(
            f"subject {subject} has no take{of_layout} with reference angles{besides}; import some with "
            f"glovecal take import{_shapes_instead(rows, subject)}"
        )
    return [row["id"] for row in chosen], layouts[0]


def _shapes_instead(rows: list[dict[str, Any]], subject: str) -> str:
    """What takes of hand shapes are good for, where there are some."""
    if not any(row["hand_shape"] for row in rows):
        return ""
    return f". From its hand shapes: glovecal train --subject {subject} --method template"
