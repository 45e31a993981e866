"""``glovecal train``: a calibration model from a subject's takes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from glovecal_models.calibration.people_prior import PeoplePrior
from glovecal_models.hand.rotations import Handedness
from glovecal_service.cli.asking import options_of
from glovecal_service.cli.take.rows import find_takes, only_layout, stored_takes, takes_of
from glovecal_service.cli.terminal.connection import connect, is_remote
from glovecal_service.cli.terminal.options import AsJson, OnlyHand, OnlyLayout, Subject
from glovecal_service.cli.terminal.presenting import present
from glovecal_service.cli.terminal.printing import Refusal, err, out, print_json
from glovecal_service.cli.terminal.waiting import begun_job, wait_for_job
from glovecal_service.plain import read
from glovecal_service.questions.train import TRAIN, TrainingRequest
from glovecal_service.rest.job.answer import JobFacts
from glovecal_service.rest.take.answer import Take

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient


@options_of(
    TrainingRequest,
    "method",
    "pseudo_inputs",
    "samples",
    "folds",
    "seed",
    "keep_dead",
    "prior",
    "people",
    "people_wearing",
    "activate",
)
def train(
    subject: Subject,
    asked: dict[str, Any],
    layout: OnlyLayout = None,
    take: Annotated[
        list[str] | None,
        typer.Option(
            "--take", "-t", help="Take to train on; repeat. Default: all with reference or touches."
        ),
    ] = None,
    leave_out: Annotated[list[str] | None, typer.Option(help="Take to keep for testing; repeat.")] = None,
    hand: OnlyHand = None,
    people_file: Annotated[
        Path | None,
        typer.Option(exists=True, dir_okay=False, help="A prior of people, by glovecal glove people."),
    ] = None,
    wait: Annotated[bool, typer.Option(help="Wait for the model, else only start the job.")] = True,
    as_json: AsJson = False,
) -> None:
    """Train a calibration model; the error it prints is on takes left out of training.

    Ctrl-C cancels the job; what it finished is kept for the next try.
    """
    if asked["folds"] == 1:
        raise typer.BadParameter("--folds 1 would hold out everything; give 0, or 2 or more")
    if not wait and not is_remote():
        raise typer.BadParameter(
            "--no-wait needs a service that goes on after this command: set GLOVECAL_URL"
        )
    if people_file is not None:
        asked["people_prior"] = PeoplePrior.load(people_file.read_bytes(), str(people_file)).to_document()
    with connect() as service:
        chosen, layout = _choose(service, subject, layout, hand, take or [], leave_out or [], asked["method"])
        job = service.post("/models/train", {**asked, "subject": subject, "layout": layout, "takes": chosen})
        if not wait:
            _say_job(job, as_json)
            return
        result = wait_for_job(service, begun_job(job), quiet=as_json).result
        found = TRAIN.read(result)
        document = service.get(f"/models/{found.model}") if as_json else None
    if as_json:
        print_json({"result": result, "model": document})
        return
    for sentence in found.sentences:
        err.print(sentence)
    present(found.presentation())


def _say_job(document: dict[str, Any], as_json: bool) -> None:
    if as_json:
        print_json(document)
    else:
        job = read(JobFacts, document)
        out.print(f"Job {job.id} is {job.state}; wait for it with glovecal job wait {job.id}")


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
    from glovecal_models.calibration.methods import OF_SHAPES

    service.get(f"/subjects/{subject}")
    rows = stored_takes(service, subject=subject)
    without = {row.id for row in find_takes(rows, left_out)}
    teaching = [row for row in rows if row.teaches or (row.hand_shape and method in OF_SHAPES)]
    chosen = find_takes(rows, wanted) or takes_of(teaching, hand)
    for row in chosen:
        if row not in teaching:
            raise Refusal(
                f"take {row.name} ({row.id}) has no reference angles; attach some with "
                f"glovecal take reference {row.id} FILE"
            )
    chosen = [row for row in chosen if row.id not in without and layout in (None, row.layout)]
    found = only_layout(chosen)
    if found is None:
        of_layout = f" with layout {layout}" if layout else ""
        besides = " besides those left out" if without else ""
        raise Refusal(
            f"subject {subject} has no take{of_layout} with reference angles{besides}; import some with "
            f"glovecal take import{_shapes_instead(rows, subject)}"
        )
    return [row.id for row in chosen], found


def _shapes_instead(rows: list[Take], subject: str) -> str:
    """What takes of hand shapes are good for, where there are some."""
    if not any(row.hand_shape for row in rows):
        return ""
    return f". From its hand shapes: glovecal train --subject {subject} --method template"
