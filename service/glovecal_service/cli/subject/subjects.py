"""``glovecal subject``: the people who wear gloves, and the sizes of their hands."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated
from zipfile import ZipFile

import typer

from glovecal_models.documents import read_json, read_toml
from glovecal_models.errors import BadInput
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.rotations import HANDS, Handedness
from glovecal_models.hand.skeleton import Palm
from glovecal_service.cli.take.rows import stored_takes
from glovecal_service.cli.terminal.connection import connect, stored_models
from glovecal_service.cli.terminal.listing import (
    AfterPlace,
    EveryRow,
    MostRows,
    Wanted,
    Words,
    filtered,
)
from glovecal_service.cli.terminal.options import AsJson, OnlyLayout, subject_named
from glovecal_service.cli.terminal.printing import (
    Overwrite,
    Refusal,
    err,
    out,
    print_facts,
    print_sentences,
    print_table,
    read_or_print,
    require_place,
    text,
    write_whole,
)
from glovecal_service.plain import read
from glovecal_service.rest.subject.answer import Erasure, HistoryView, SkeletonView
from glovecal_service.rest.subject.answer import Subject as SubjectRow
from glovecal_service.rest.take.answer import Take

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

app = typer.Typer(help="The people who wear gloves.", no_args_is_help=True)

Name = Annotated[str, typer.Argument(help="Short name: a-z, 0-9, _ and -.", callback=subject_named)]

HandLength = Annotated[
    float | None,
    typer.Option(
        "--hand-length-mm",
        help="From the wrist crease to the tip of the middle finger; other sizes are derived.",
    ),
]
DimensionsFile = Annotated[
    Path | None,
    typer.Option(
        "--dimensions",
        help="TOML file of measured sizes in mm, such as hand_length = 190; glovecal subject skeleton NAME "
        "lists all names.",
        exists=True,
        dir_okay=False,
    ),
]
HISTORY = {
    "made_at": "when",
    "kind": "what",
    "wearing": "wearing",
    "as_found_deg": "as found (°)",
    "as_left_deg": "as left (°)",
    "rmse_unseen_wearing_deg": "next wearing (°)",
    "held_out_rmse_deg": "error (°)",
    "short": "model",
}
Hand = Annotated[Handedness | None, typer.Option("--hand", help="right or left.")]


@app.command("add")
def add(
    name: Name,
    title: Annotated[str, typer.Option(help="Full name.")] = "",
    hand_length_mm: HandLength = None,
    dimensions: DimensionsFile = None,
    hand: Hand = None,
) -> None:
    """Add a subject; with hand sizes, errors are also given in mm."""
    measured = measured_dimensions(hand_length_mm, dimensions)
    body = {"name": name, "title": title, "dimensions": measured, "hand": hand}
    with connect() as service:
        service.post("/subjects", body)
    out.print(f"Added subject {name}.")


@app.command("measure")
def measure(
    name: Name,
    hand_length_mm: HandLength = None,
    dimensions: DimensionsFile = None,
    hand: Hand = None,
) -> None:
    """Set the measured sizes of a subject's hand, earlier ones are replaced; or say which hand it is."""
    if hand_length_mm is None and dimensions is None and hand is None:
        raise typer.BadParameter("give --hand-length-mm, --dimensions or --hand")
    measured = measured_dimensions(hand_length_mm, dimensions)
    with connect() as service:
        if not measured:
            measured = read(SubjectRow, service.get(f"/subjects/{name}")).dimensions
        body = {"dimensions": measured, "hand": hand}
        kept = read(SubjectRow, service.put(f"/subjects/{name}/hand", body))
    which = "hand unknown" if kept.hand == "unknown" else f"{kept.hand} hand"
    out.print(f"Subject {name}: {which}, {text(measured)} mm." if measured else f"Subject {name}: {which}.")


@app.command("history")
def history(name: Name, layout: OnlyLayout = None, as_json: AsJson = False) -> None:
    """Show calibrations and quick checks in order of time: errors as found, as left, and what is due."""
    with connect() as service:
        document = service.get(f"/subjects/{name}/history", {"layout": layout})
    found = read_or_print(HistoryView, document, as_json)
    rows = [{**vars(row), "short": row.model[:12]} for row in found.rows]
    print_table(rows, HISTORY, empty=f"No models yet. Train one: glovecal train --subject {name}")
    for sentence in found.sentences:
        out.print(sentence)


@app.command("skeleton")
def skeleton(
    name: Name,
    hand: Hand = None,
    palm: Annotated[
        Palm, typer.Option(help="arching: with the joint of the little finger's metacarpal.")
    ] = "rigid",
    as_json: AsJson = False,
) -> None:
    """Show the sizes of a subject's hand; --json prints joints, axes and limits for a viewer."""
    with connect() as service:
        document = service.get(f"/subjects/{name}/skeleton", {"palm": palm, "hand": hand})
    found = read_or_print(SkeletonView, document, as_json)
    sizes, measured = found.dimensions.sizes, found.dimensions.measured
    rows = [{"name": key, "mm": f"{mm:.1f}", "from": _origin(key, measured)} for key, mm in sizes.items()]
    print_table(rows, {"name": f"{found.hand} hand", "mm": "mm", "from": ""}, empty="")


@app.command("robot")
def robot(
    name: Name,
    file: Annotated[Path, typer.Argument(help="Where to write; .urdf for ROS, .xml for MuJoCo (MJCF).")],
    hand: Hand = None,
    palm: Annotated[
        Palm, typer.Option(help="arching: with the joint of the little finger's metacarpal.")
    ] = "rigid",
    overwrite: Overwrite = False,
) -> None:
    """Write a subject's hand for robotics; its joints have the names of the rotations."""
    forms = {".urdf": "urdf", ".xml": "mjcf"}
    form = forms.get(file.suffix.lower())
    if form is None:
        raise typer.BadParameter(f"{file.name!r} must end in .urdf (for ROS) or .xml (for MuJoCo)")
    require_place(file, overwrite=overwrite)
    with connect() as service:
        query = {"form": form, "palm": palm} | ({} if hand is None else {"hand": hand})
        write_whole({file: service.download(f"/subjects/{name}/robot", query)})


def _origin(dimension: str, measured: list[str]) -> str:
    if dimension in measured:
        return "measured"
    return "from the hand length" if measured else "assumed"


@app.command("list")
def list_subjects(
    text: Words = None,
    limit: MostRows = None,
    every: EveryRow = False,
    after: AfterPlace = None,
    as_json: AsJson = False,
) -> None:
    """List subjects by name."""
    wanted, query = Wanted(limit, every, after, as_json), {"text": text}
    with connect() as service:
        rows = wanted.rows(service, SubjectRow, "/subjects", filtered("subject list", **query), query)
    rows = [{**vars(row), "title": row.title or None} for row in rows]
    columns = {"name": "subject", "title": "name", "created_at": "added"}
    print_table(rows, columns, empty="No subjects yet. Add one: glovecal subject add NAME")


@app.command("show")
def show(name: Name, as_json: AsJson = False) -> None:
    """Show one subject: takes, models and the active model."""
    with connect() as service:
        document = service.get(f"/subjects/{name}")
        takes = stored_takes(service, subject=name)
        models = stored_models(service, subject=name)
    found = read_or_print(SubjectRow, document, as_json)
    print_facts(
        {
            "subject": name,
            "name": found.title or None,
            "hand": " and ".join(_hands(found, takes)) or "unknown",
            "measured (mm)": found.dimensions,
            "added": found.created_at,
            "takes": len(takes),
            "models": len(models),
            "active": [
                f"{row.short} ({', '.join(filter(None, (row.method, row.layout, row.hand)))})"
                for row in models
                if row.active
            ],
        }
    )


def _hands(subject: SubjectRow, takes: list[Take]) -> list[str]:
    """Those that the subject is said to have, and those whose gloves recorded its takes."""
    return [hand for hand in HANDS if hand in (subject.hand, *(row.known_hand for row in takes))]


@app.command("export")
def export(
    name: Name,
    to: Annotated[Path, typer.Option("--to", help="Where to write; a .zip file.", metavar="FILE.zip")],
    overwrite: Overwrite = False,
) -> None:
    """Write all that is kept of a subject into one file, for the subject: takes, recordings, videos, models,
    jobs and changes, with a README. Needs the role trainer."""
    if to.suffix.lower() != ".zip":
        raise typer.BadParameter(f"{to.name!r} must end in .zip")
    require_place(to, overwrite=overwrite)
    with connect() as service:
        service.save(f"/subjects/{name}/export", to)
    with ZipFile(to) as archive:
        manifest = read_json(archive.read("manifest.json"), "manifest.json of the export")
    size = sum(row["bytes"] for row in manifest["files"]) / 1e6
    out.print(
        f"Wrote {to}: {len(manifest['files'])} files, {size:.1f} MB; README.txt in it says what each is."
    )
    for problem in manifest["problems"]:
        err.print(problem, style="yellow")


@app.command("erase")
def erase(
    name: Name,
    yes: Annotated[
        str | None,
        typer.Option("--yes", metavar="NAME", help="The name again, for scripts; else it is asked for."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Remove a subject with all that is kept of it, for ever: takes, recordings, videos, models, samplings,
    jobs. The log of changes keeps that it was done. Needs the role admin."""
    asked = f"This cannot be undone. Type {name} to erase all that is kept of it"
    again = typer.prompt(asked, err=True) if yes is None else yes
    if again.strip().lower() != name:
        raise Refusal(f"{again.strip()!r} is not {name!r}: nothing was changed. Give the subject's own name.")
    with connect() as service:
        document = service.post("/erasures", {"subject": name})
    erased = read_or_print(Erasure, document, as_json)
    print_facts({"removed": {key: count for key, count in erased.removed.items() if count}})
    print_sentences(erased.sentences)


@app.command("remove")
def remove(
    name: Name,
    takes: Annotated[
        bool, typer.Option("--takes", help="Also remove its takes, except those of models.")
    ] = False,
) -> None:
    """Remove a subject that owns no takes and no models. Imported files stay in the data folder."""
    with connect() as service:
        if takes:
            _remove_takes(service, name)
        service.delete(f"/subjects/{name}")
    out.print(f"Removed subject {name}.")


def _remove_takes(service: RestClient, subject: str) -> None:
    """All or none: takes that a model was trained on stay, so a subject with models keeps all."""
    models = stored_models(service, subject=subject)
    if models:
        raise Refusal(
            f"subject {subject} has {len(models)} models, which need the takes they were trained on"
        )
    for row in stored_takes(service, subject=subject):
        service.delete(f"/takes/{row.id}")
        out.print(f"Removed take {row.name} ({row.id}).")


def measured_dimensions(length_mm: float | None, file: Path | None) -> dict[str, float]:
    """What was measured, in mm; the length given by itself counts. Raises Refusal that names the file."""
    try:
        measured = {} if file is None else read_toml(file.read_bytes(), str(file))
    except BadInput as error:
        raise Refusal(str(error)) from error
    try:
        wrong = [name for name, value in measured.items() if type(value) not in (int, float)]
        if wrong:
            raise BadInput(f"{wrong[0]} is {measured[wrong[0]]!r}; give a number of mm")
        if length_mm is not None:
            measured |= {"hand_length": length_mm}
        HandDimensions.from_measured(measured)
    except BadInput as error:
        raise Refusal(f"{file}: {error}" if file is not None else str(error)) from error
    return {name: float(value) for name, value in measured.items()}
