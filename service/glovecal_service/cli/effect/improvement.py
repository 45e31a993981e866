"""``glovecal improve``: train, then add what the diagnosis names while the error falls."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from glovecal_models.hand.rotations import Handedness
from glovecal_service.cli.asking import options_of
from glovecal_service.cli.glove.layouts import layout_named
from glovecal_service.cli.take.files import FileSubject
from glovecal_service.cli.take.rows import find_takes, only_layout, stored_takes, takes_of
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, OnlyHand, subject_named
from glovecal_service.cli.terminal.presenting import present
from glovecal_service.cli.terminal.printing import (
    Overwrite,
    Refusal,
    Report,
    err,
    fetch_job_report,
    read_or_print,
    require_place,
    write_report,
)
from glovecal_service.cli.terminal.waiting import begun_job, wait_for_job
from glovecal_service.questions.improve import IMPROVE, ImprovementRequest
from glovecal_service.rest.take.answer import Take

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

MANY = ("--takes", "--holdout", "--take", "-t")


class SeveralFiles(TyperCommand):
    """Lets ``--takes a.csv b.csv`` stand for ``--takes a.csv --takes b.csv``, so that a shell's * works."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        repeated: list[str] = []
        option = ""
        for number, word in enumerate(args):
            if word.startswith("-") and word != "-":
                option = word if word in MANY else ""
            elif option and args[number - 1] != option:
                repeated.append(option)
            repeated.append(word)
        return super().parse_args(ctx, repeated)


@options_of(ImprovementRequest, "method", "samples", "max_steps", "seed", "ceiling", "activate")
def improve(
    asked: dict[str, Any],
    takes: Annotated[
        list[Path] | None,
        typer.Option(exists=True, dir_okay=False, help="Take tables (CSV, Parquet) to learn from; several."),
    ] = None,
    holdout: Annotated[
        list[str] | None,
        typer.Option(help="Take tables, or names of stored takes, that errors are measured on; several."),
    ] = None,
    take: Annotated[
        list[str] | None,
        typer.Option("--take", "-t", help="Stored takes of the subject to learn from; several."),
    ] = None,
    subject: Annotated[
        str | None,
        typer.Option(
            "--subject",
            "-s",
            help="Whose takes they are. Default: whoever has the files already, else a new improve-...",
            callback=subject_named,
        ),
    ] = None,
    layout: Annotated[
        str | None,
        typer.Option("--layout", "-l", help="Layout name or layout file. Default: made of the columns."),
    ] = None,
    hand: OnlyHand = None,
    spread_equal_times: Annotated[
        bool,
        typer.Option("--spread-equal-times", help="Frames stamped in batches: spread each over its batch."),
    ] = False,
    report: Report = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Train a model, then add what the diagnosis names, as long as the held-out error falls.

    Files are imported under the subject and stay there with every model on the way, so that each can be
    looked at, activated or continued; the same files again are not imported twice. Without --holdout errors
    are on takes held out of each fit.
    """
    if report is not None:
        require_place(report, overwrite=overwrite)
    with connect() as service:
        chosen = _chosen(
            service, takes or [], holdout or [], take or [], subject, layout, hand, spread=spread_equal_times
        )
        job = begun_job(service.post("/improve", {**chosen, **asked}))
        result = wait_for_job(service, job, quiet=as_json).result
        page = fetch_job_report(service, job, report) if report is not None else b""
    if report is not None:
        write_report(report, page, as_json=as_json)
    answer = read_or_print(IMPROVE.answer, result, as_json)
    for sentence in answer.sentences:
        err.print(sentence)
    present(answer.presentation())


def _chosen(
    service: RestClient,
    files: Sequence[Path],
    holdout: Sequence[str],
    take: Sequence[str],
    subject: str | None,
    layout: str | None,
    hand: Handedness | None,
    *,
    spread: bool,
) -> dict[str, Any]:
    """The takes to learn from and to hold out, imported where they are files."""
    layout = layout_named(service, layout)
    held_files = [Path(item) for item in holdout if Path(item).is_file()]
    held_names = [item for item in holdout if not Path(item).is_file()]
    every = [*files, *held_files]
    if not files and subject is None:
        raise typer.BadParameter("name files with --takes, or a subject with --subject")
    if subject is not None and not every:
        service.get(f"/subjects/{subject}")
    learned, held = [], []
    if every:
        of_files = FileSubject.of(service, every, subject=subject, layout=layout, spread=spread)
        subject = of_files.name
        learned, held = of_files.take_ids(files), of_files.take_ids(held_files)
        layout = of_files.layout
    rows = stored_takes(service, subject=subject)
    held += [row.id for row in find_takes(rows, held_names)]
    learned += [row.id for row in find_takes(rows, take)]
    if not learned:
        learned = [
            row.id
            for row in takes_of(rows, hand)
            if row.rotations and row.id not in held and layout in (None, row.layout)
        ]
    if not learned:
        raise Refusal(
            f"subject {subject} has no take with reference angles to learn from; import some with glovecal "
            f"take import, or name files with --takes{_poses_instead(rows, subject)}"
        )
    of_all = only_layout(row for row in rows if row.id in {*learned, *held})
    return {"subject": subject, "layout": layout or of_all, "takes": learned, "holdout": held or None}


def _poses_instead(rows: Sequence[Take], subject: str | None) -> str:
    if not rows:
        return ""
    return f"; glovecal take holds --subject {subject} shows what readings do in held poses"
