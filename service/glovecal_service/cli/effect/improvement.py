"""``glovecal improve``: train, then add what the diagnosis names while the error falls."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from typer.core import TyperCommand

from glovecal_models.hand.handedness import Handedness
from glovecal_service.cli.glove.layouts import layout_named
from glovecal_service.cli.take.files import FileSubject
from glovecal_service.cli.take.rows import find_takes, takes_of
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.floor_doubts import print_floor_doubts
from glovecal_service.cli.terminal.options import AsJson, OnlyHand, subject_named
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

MANY = ("--takes", "--holdout", "--take", "-t")
STOPPED = {
    "noise_floor": "the error is at its noise floor",
    "nothing_named": "no known effect beats its control significantly",
    "ambiguous": "these takes cannot tell the causes apart",
    "not_better": "the next effect did not reduce the held-out error enough and was undone",
}
STEPS = {
    "model": "model",
    "added": "added",
    "rmse_unseen_wearing_deg": "next wearing (°)",
    "rmse_deg": "error (°)",
}
Method = Literal["lmc_gpr", "linear", "spgp", "auto", "polynomial_gpr", "general_gpr"]


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


def improve(
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
    method: Annotated[Method, typer.Option(help="The base that effects are added to.")] = "lmc_gpr",
    samples: Annotated[int, typer.Option(min=10, max=5000, help="Most samples for one rotation.")] = 2000,
    max_steps: Annotated[int, typer.Option(min=0, max=20, help="Effects to add at most.")] = 6,
    seed: Annotated[int, typer.Option(min=0, help="Of what is chosen at random.")] = 0,
    ceiling: Annotated[
        bool, typer.Option(help="Ask at the end whether anything is left to gain from what was recorded.")
    ] = True,
    spread_equal_times: Annotated[
        bool,
        typer.Option("--spread-equal-times", help="Frames stamped in batches: spread each over its batch."),
    ] = False,
    activate: Annotated[bool, typer.Option("--activate", help="Predict live with the last model.")] = False,
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
        options = {"method": method, "samples": samples, "max_steps": max_steps, "seed": seed}
        options["ceiling"] = ceiling
        job = service.post("/improve", {**chosen, **options, "activate": activate})["id"]
        result = wait_for_job(service, job, quiet=as_json)["result"]
        page = fetch_job_report(service, job) if report is not None else b""
    if report is not None:
        write_report(report, page, as_json=as_json)
    if as_json:
        print_json(result)
    else:
        _print(chosen["subject"], method, result, active=activate)


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
    rows = service.get("/takes", {"subject": subject})
    held += [row["id"] for row in find_takes(rows, held_names)]
    learned += [row["id"] for row in find_takes(rows, take)]
    if not learned:
        learned = [
            row["id"]
            for row in takes_of(rows, hand)
            if row["rotations"] and row["id"] not in held and layout in (None, row["layout"])
        ]
    layouts = sorted({row["layout"] for row in rows if row["id"] in {*learned, *held}})
    if not learned:
        raise Refusal(
            f"subject {subject} has no take with reference angles to learn from; import some with glovecal "
            f"take import, or name files with --takes{_poses_instead(rows, subject)}"
        )
    if len(layouts) > 1:
        raise Refusal(f"the takes have layouts {', '.join(layouts)}; choose one with --layout")
    return {"subject": subject, "layout": layout or layouts[0], "takes": learned, "holdout": held or None}


def _poses_instead(rows: Sequence[Mapping[str, Any]], subject: str | None) -> str:
    if not rows:
        return ""
    return f"; glovecal take holds --subject {subject} shows what readings do in held poses"


def _print(subject: str, method: str, result: Mapping[str, Any], *, active: bool) -> None:
    rows = [
        {
            "model": step["model"][:12],
            "added": _added(step["added"], method),
            "rmse_unseen_wearing_deg": step["rmse_unseen_wearing_deg"],
            "rmse_deg": step["rmse_deg"],
        }
        for step in result["steps"]
    ]
    print_table(rows, STEPS, empty="", folds="added")
    floors = ", ".join(f"{name} {value:.2f}" for name, value in (result["noise_floor_deg"] or {}).items())
    out.print(f"Noise floors (°): {floors or 'unknown'}")
    print_floor_doubts(result["noise_floors"])
    out.print(f"Stopped: {STOPPED.get(result['stopped'], result['stopped'])}.")
    for sentence in result["sentences"]:
        err.print(sentence)
    following = result["next_take"]
    if following:
        rivals = " and ".join(following["separates"])
        out.print(f"To separate {rivals}, record {following['seconds']} s: {following['what']}")
    last = result["steps"][-1]["model"][:12]
    out.print(f"The models are kept for subject {subject}.")
    out.print("The last is active." if active else f"Next: glovecal model activate {last}")


def _added(added: Mapping[str, Any] | None, method: str) -> str:
    if added is None:
        return f"{method} alone"
    rivals = [name for name in added.get("confidence_set") or () if name != added["effect"]]
    doubt = f" (or {', '.join(rivals)})" if rivals else ""
    if added["verdict"] == "associated":
        column = added.get("associated_with")
        doubt = f" (associated{f' with {column}' if column else ''}; no cause is claimed)"
    return f"{added['effect']} on {', '.join(added['where'])}{doubt}"
